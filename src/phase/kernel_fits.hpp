#pragma once

// Helpers of all kernels and bodies of those that fit phase sets, inlined into one wrapper per
// instruction set. No standard library and no Eigen here: nothing compiled for AVX2 may end up in
// code that others share.

#include "kernels.hpp"

#define FRINGE_FUSION_INLINE static inline __attribute__((always_inline))

namespace fringe_fusion::decode {

constexpr std::int32_t kTooDark = 1;
constexpr std::int32_t kShadow = 8;
// Grey values are whole numbers: amplitudes below these have no phase.
constexpr float kLeastAmplitude = 1e-3F;
constexpr float kLeastAmplitude2 = 1e-6F;
constexpr float kTiny = 1e-20F;

FRINGE_FUSION_INLINE float Larger(float a, float b) { return a > b ? a : b; }
FRINGE_FUSION_INLINE std::int32_t Larger(std::int32_t a, std::int32_t b) { return a > b ? a : b; }
FRINGE_FUSION_INLINE float Smaller(float a, float b) { return a < b ? a : b; }

// To the nearest integer, for |x| < 2^22.
FRINGE_FUSION_INLINE float RoundToInteger(float x) { return (x + 12582912.0F) - 12582912.0F; }

FRINGE_FUSION_INLINE float WrapToUnit(float cycles) {
  const float rest = cycles - RoundToInteger(cycles);
  return rest < 0.0F ? rest + 1.0F : rest;
}

// atan(r) / (2 pi) in the octant of (sine, cosine), r = least over largest of their magnitudes.
// Ref: Abramowitz & Stegun 1964, 4.4.49, error below 2e-8 rad.
FRINGE_FUSION_INLINE float CyclesOf(float sine, float cosine, float r) {
  const float r2 = r * r;
  float p = 0.0028662257F;
  p = p * r2 - 0.0161657367F;
  p = p * r2 + 0.0429096138F;
  p = p * r2 - 0.0752896400F;
  p = p * r2 + 0.1065626393F;
  p = p * r2 - 0.1420889944F;
  p = p * r2 + 0.1999355085F;
  p = p * r2 - 0.3333314528F;
  float t = (r + r * (r2 * p)) * 0.15915494309F;
  t = __builtin_fabsf(sine) > __builtin_fabsf(cosine) ? 0.25F - t : t;
  t = cosine < 0.0F ? 0.5F - t : t;
  return sine < 0.0F ? -t : t;
}

FRINGE_FUSION_INLINE void BytesToFloatBody(const std::uint8_t* __restrict in, float* __restrict out,
                                           int count) {
  for (int x = 0; x < count; ++x) out[x] = static_cast<float>(in[x]);
}

FRINGE_FUSION_INLINE void WordsToFloatBody(const std::uint16_t* __restrict in,
                                           float* __restrict out, int count) {
  for (int x = 0; x < count; ++x) out[x] = static_cast<float>(in[x]);
}

FRINGE_FUSION_INLINE void ExtendRangeBody(const float* __restrict in, float* __restrict low,
                                          float* __restrict high, int count) {
  for (int x = 0; x < count; ++x) {
    low[x] = Smaller(low[x], in[x]);
    high[x] = Larger(high[x], in[x]);
  }
}

/// A, a = B cos phi, b = B sin phi and what is known about them.
struct Fit {
  float offset;
  float cosine;
  float sine;
  float octant_ratio;  // least over largest magnitude of a and b
  float amplitude2;
  float variance_rad2;
  float residual;        // chi^2
  float residual_limit;  // of the same
  float num_samples;
  float peak;
};

FRINGE_FUSION_INLINE std::int32_t Store(const Fit& fit, const FitArgs& args, const FitOut& out,
                                        int x) {
  constexpr float kInverseTwoPi2 = 0.0253302959F;  // 1 / (2 pi)^2
  const float cycles = CyclesOf(fit.sine, fit.cosine, fit.octant_ratio);
  out.cycles[x] = WrapToUnit(args.sign * cycles - args.offset_cycles);
  out.variance[x] = kInverseTwoPi2 * fit.variance_rad2;
  out.offset[x] = fit.offset;
  out.amplitude2[x] = fit.amplitude2;
  // Science 2.1: var phi = 2 sigma_I^2 / (N B^2), so this is (sigma_I / B)^2 of an equal even set.
  const float noise_ratio2 = 0.5F * fit.num_samples * fit.variance_rad2;
  std::int32_t status = fit.residual <= fit.residual_limit ? kRowValid : kRowResidual;
  status = args.limits.min_modulation2 * noise_ratio2 <= 1.0F ? status : kRowLowModulation;
  status = fit.peak < args.limits.saturation_dn ? status : kRowSaturated;
  out.status[x] = status;
  return status;
}

FRINGE_FUSION_INLINE float LeastMagnitude(const Fit& fit) {
  return Smaller(__builtin_fabsf(fit.sine), __builtin_fabsf(fit.cosine));
}

FRINGE_FUSION_INLINE float LargestMagnitude(const Fit& fit) {
  const float largest = Larger(__builtin_fabsf(fit.sine), __builtin_fabsf(fit.cosine));
  return Larger(largest, kLeastAmplitude);
}

// Three steps determine A, a and b: weights change nothing. Shot noise follows the fringe and with
// N = 3 its first harmonic does not cancel: var phi = 2/(3 B^2) (sigma_A^2 - gain B cos(3 phi) /
// 2).
FRINGE_FUSION_INLINE std::int32_t FitThreeBody(const FitArgs& args, const FitOut& out, int count) {
  const float* __restrict i0 = args.frames[0];
  const float* __restrict i1 = args.frames[1];
  const float* __restrict i2 = args.frames[2];
  std::int32_t greatest = kRowValid;
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    Fit fit{};
    fit.offset = (i0[x] + i1[x] + i2[x]) * (1.0F / 3.0F);
    fit.cosine = (2.0F * i0[x] - i1[x] - i2[x]) * (1.0F / 3.0F);
    fit.sine = (i1[x] - i2[x]) * 0.57735026919F;
    const float a = fit.cosine;
    fit.amplitude2 = a * a + fit.sine * fit.sine;
    // One division serves all quotients.
    const float b2 = Larger(fit.amplitude2, kLeastAmplitude2);
    const float largest = LargestMagnitude(fit);
    const float inverse = 1.0F / (b2 * largest);
    const float inverse_b2 = largest * inverse;
    fit.octant_ratio = LeastMagnitude(fit) * (b2 * inverse);
    const float noise = args.noise.floor_dn2 + args.noise.gain_dn * fit.offset;
    const float third = 0.5F * args.noise.gain_dn * a * (4.0F * (a * a * inverse_b2) - 3.0F);
    fit.variance_rad2 = (2.0F / 3.0F) * Larger(noise - third, 0.25F * noise) * inverse_b2;
    fit.num_samples = 3.0F;
    fit.peak = Larger(i0[x], Larger(i1[x], i2[x]));
    greatest = Larger(greatest, Store(fit, args, out, x));
  }
  return greatest;
}

// Four steps leave one contrast z = (I0 - I1 + I2 - I3) / 4 that is noise alone. Shot noise
// correlates it with a and b; the weighted least squares takes that part out in closed form:
// a (1 - e), b (1 + e), e = gain z / sigma_A^2, with the covariance of the corrected values.
FRINGE_FUSION_INLINE std::int32_t FitFourBody(const FitArgs& args, const FitOut& out, int count) {
  const float* __restrict i0 = args.frames[0];
  const float* __restrict i1 = args.frames[1];
  const float* __restrict i2 = args.frames[2];
  const float* __restrict i3 = args.frames[3];
  const float gain = args.noise.gain_dn;
  std::int32_t greatest = kRowValid;
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    Fit fit{};
    const float even = i0[x] + i2[x];
    const float odd = i1[x] + i3[x];
    fit.offset = 0.25F * (even + odd);
    const float z = 0.25F * (even - odd);
    const float noise = args.noise.floor_dn2 + gain * fit.offset;
    const float a = 0.5F * (i0[x] - i2[x]);
    const float b = 0.5F * (i1[x] - i3[x]);
    // e is small: B^2 and the octant of the plain fit serve as divisors of the corrected one.
    fit.cosine = a;
    fit.sine = b;
    const float plain_b2 = a * a + b * b;
    const float b2 = Larger(plain_b2, kLeastAmplitude2);
    const float inverse = 1.0F / (noise * b2);
    const float inverse_noise = b2 * inverse;
    const float inverse_b2 = noise * inverse;
    const float e = Larger(-0.5F, Smaller(0.5F, gain * z * inverse_noise));
    fit.cosine = a * (1.0F - e);
    fit.sine = b * (1.0F + e);
    fit.octant_ratio = LeastMagnitude(fit) / LargestMagnitude(fit);
    fit.amplitude2 = plain_b2;
    const float gained = gain * gain * inverse_noise * (a * a * inverse_b2) * (b * b);
    fit.variance_rad2 = Larger(0.5F * noise - gained, 0.05F * noise) * inverse_b2;
    fit.residual = 4.0F * z * z * inverse_noise;
    fit.residual_limit =
        args.limits.max_residual2 + 4.0F * args.limits.harmonic2 * b2 * inverse_noise;
    fit.num_samples = 4.0F;
    fit.peak = Larger(Larger(i0[x], i1[x]), Larger(i2[x], i3[x]));
    greatest = Larger(greatest, Store(fit, args, out, x));
  }
  return greatest;
}

constexpr int kBlock = 64;

/// Weighted normal equations of A, a, b for a block of pixels.
struct NormalBlock {
  float aa[kBlock], ab[kBlock], ac[kBlock], bb[kBlock], bc[kBlock], cc[kBlock];
  float ra[kBlock], rb[kBlock], rc[kBlock];
};

struct SolutionBlock {
  float a[kBlock], b[kBlock], c[kBlock];
  float vbb[kBlock], vbc[kBlock], vcc[kBlock];  // covariance of b and c
};

// Variance of a grey value: at the measured value first, at the fitted one then.
template <bool kFirst>
FRINGE_FUSION_INLINE void Accumulate(const FitArgs& args, int begin, const SolutionBlock& previous,
                                     NormalBlock& sums) {
  float* all = sums.aa;
  for (int i = 0; i < 9 * kBlock; ++i) all[i] = 0.0F;
  for (int n = 0; n < args.num_samples; ++n) {
    const float* __restrict in = args.frames[n] + begin;
    const float t = args.exposures[n];
    const float tc = t * args.cosines[n];
    const float ts = t * args.sines[n];
#pragma GCC ivdep
    for (int i = 0; i < kBlock; ++i) {
      const float grey = in[i];
      const float model =
          kFirst ? grey : t * previous.a[i] + tc * previous.b[i] + ts * previous.c[i];
      const float noise = args.noise.floor_dn2 + args.noise.gain_dn * Larger(model, 0.0F);
      const float w = grey < args.limits.saturation_dn ? 1.0F / noise : 0.0F;
      sums.aa[i] += w * (t * t);
      sums.ab[i] += w * (t * tc);
      sums.ac[i] += w * (t * ts);
      sums.bb[i] += w * (tc * tc);
      sums.bc[i] += w * (tc * ts);
      sums.cc[i] += w * (ts * ts);
      sums.ra[i] += w * (t * grey);
      sums.rb[i] += w * (tc * grey);
      sums.rc[i] += w * (ts * grey);
    }
  }
}

// Inverse of the symmetric 3 x 3 matrix by cofactors.
FRINGE_FUSION_INLINE void Solve(const NormalBlock& m, SolutionBlock& out) {
#pragma GCC ivdep
  for (int i = 0; i < kBlock; ++i) {
    const float caa = m.bb[i] * m.cc[i] - m.bc[i] * m.bc[i];
    const float cab = m.ac[i] * m.bc[i] - m.ab[i] * m.cc[i];
    const float cac = m.ab[i] * m.bc[i] - m.ac[i] * m.bb[i];
    const float cbb = m.aa[i] * m.cc[i] - m.ac[i] * m.ac[i];
    const float cbc = m.ab[i] * m.ac[i] - m.aa[i] * m.bc[i];
    const float ccc = m.aa[i] * m.bb[i] - m.ab[i] * m.ab[i];
    const float det = m.aa[i] * caa + m.ab[i] * cab + m.ac[i] * cac;
    const float inverse = 1.0F / Larger(det, kTiny);
    out.a[i] = inverse * (caa * m.ra[i] + cab * m.rb[i] + cac * m.rc[i]);
    out.b[i] = inverse * (cab * m.ra[i] + cbb * m.rb[i] + cbc * m.rc[i]);
    out.c[i] = inverse * (cac * m.ra[i] + cbc * m.rb[i] + ccc * m.rc[i]);
    out.vbb[i] = inverse * cbb;
    out.vbc[i] = inverse * cbc;
    out.vcc[i] = inverse * ccc;
  }
}

/// What is left over after the fit.
struct ResidualBlock {
  float chi2[kBlock], count[kBlock], weight[kBlock], places[kBlock], last[kBlock];
};

FRINGE_FUSION_INLINE void SumResiduals(const FitArgs& args, int begin, const SolutionBlock& fit,
                                       ResidualBlock& out) {
  for (int i = 0; i < kBlock; ++i) {
    out.chi2[i] = out.count[i] = out.weight[i] = out.places[i] = 0.0F;
    out.last[i] = -1.0F;
  }
  for (int n = 0; n < args.num_samples; ++n) {
    const float* __restrict in = args.frames[n] + begin;
    const float t = args.exposures[n];
    const float tc = t * args.cosines[n];
    const float ts = t * args.sines[n];
    const auto place = static_cast<float>(args.places[n]);
#pragma GCC ivdep
    for (int i = 0; i < kBlock; ++i) {
      const float grey = in[i];
      const float model = t * fit.a[i] + tc * fit.b[i] + ts * fit.c[i];
      const float noise = args.noise.floor_dn2 + args.noise.gain_dn * Larger(model, 0.0F);
      const bool used = grey < args.limits.saturation_dn;
      const float w = used ? 1.0F / noise : 0.0F;
      out.chi2[i] += w * (grey - model) * (grey - model);
      out.weight[i] += w * (t * t);
      out.count[i] += used ? 1.0F : 0.0F;
      out.places[i] += used && out.last[i] != place ? 1.0F : 0.0F;
      out.last[i] = used ? place : out.last[i];
    }
  }
}

FRINGE_FUSION_INLINE std::int32_t StoreBlock(const FitArgs& args, const FitOut& out, int begin,
                                             int count, const SolutionBlock& s,
                                             const ResidualBlock& r) {
  std::int32_t greatest = kRowValid;
#pragma GCC ivdep
  for (int i = 0; i < count; ++i) {
    Fit fit{};
    fit.offset = s.a[i];
    fit.cosine = s.b[i];
    fit.sine = s.c[i];
    fit.amplitude2 = s.b[i] * s.b[i] + s.c[i] * s.c[i];
    fit.octant_ratio = LeastMagnitude(fit) / LargestMagnitude(fit);
    const float b2 = Larger(fit.amplitude2, kLeastAmplitude2);
    const float bb = s.b[i] * s.b[i] * s.vcc[i] + s.c[i] * s.c[i] * s.vbb[i];
    fit.variance_rad2 = Larger((bb - 2.0F * s.b[i] * s.c[i] * s.vbc[i]) / b2 / b2, kTiny);
    const float dof = Larger(r.count[i] - 3.0F, 0.0F);
    fit.residual = r.chi2[i];
    fit.residual_limit = args.limits.max_residual2 * dof +
                         args.limits.harmonic2 * b2 * r.weight[i] + (dof > 0.0F ? 0.0F : 1e30F);
    fit.num_samples = r.count[i];
    // Two shifts do not tell a phase.
    fit.peak = r.places[i] >= 3.0F ? 0.0F : args.limits.saturation_dn;
    greatest = Larger(greatest, Store(fit, args, out, begin + i));
  }
  return greatest;
}

// Science 2.7: one weighted least squares over all exposures; saturated samples have no weight.
FRINGE_FUSION_INLINE std::int32_t FitWeightedBody(const FitArgs& args, const FitOut& out,
                                                  int count) {
  NormalBlock sums;
  SolutionBlock fit;
  ResidualBlock residuals;
  std::int32_t greatest = kRowValid;
  for (int begin = 0; begin < count; begin += kBlock) {
    Accumulate<true>(args, begin, fit, sums);
    Solve(sums, fit);
    Accumulate<false>(args, begin, fit, sums);
    Solve(sums, fit);
    SumResiduals(args, begin, fit, residuals);
    const int length = count - begin < kBlock ? count - begin : kBlock;
    greatest = Larger(greatest, StoreBlock(args, out, begin, length, fit, residuals));
  }
  return greatest;
}

FRINGE_FUSION_INLINE void RaiseBody(const std::int32_t* __restrict in,
                                    std::int32_t* __restrict status, int count) {
  for (int x = 0; x < count; ++x) status[x] = Larger(status[x], in[x]);
}

}  // namespace fringe_fusion::decode
