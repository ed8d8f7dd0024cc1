#pragma once

// Helpers of all kernels and bodies of those that fit phase sets, inlined into one wrapper per
// instruction set. No standard library and no Eigen here: nothing compiled for AVX2 may end up in
// code that others share. F is a float or a vector of lanes.hpp.

#include "kernels.hpp"
#include "lanes.hpp"

namespace fringe_fusion::decode {

// Values of MaskReason.
constexpr std::int32_t kTooDark = 1;
constexpr std::int32_t kLowModulation = 2;
constexpr std::int32_t kSaturated = 3;
constexpr std::int32_t kResidual = 5;
constexpr std::int32_t kDoubtfulOrder = 6;
constexpr std::int32_t kOutsideProjector = 7;
constexpr std::int32_t kShadow = 8;
// Grey values are whole numbers: amplitudes below these have no phase.
constexpr float kLeastAmplitude2 = 1e-6F;
constexpr float kTiny = 1e-20F;
constexpr float kInverseTwoPi2 = 0.0253302959F;  // 1 / (2 pi)^2

template <typename F>
FRINGE_FUSION_INLINE F WrapToUnit(F cycles) {
  const F rest = cycles - RoundToInteger(cycles);
  return rest < 0.0F ? rest + 1.0F : rest;
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
template <typename F>
struct Fit {
  F offset;
  F cosine;
  F sine;
  F amplitude2;
  F variance_rad2;
  F misfit;          // squared residuals, to be compared with
  F largest_misfit;  // these
};

// phi / (2 pi), -1/2..1/2: atan(r) / (2 pi) in the octant of (sine, cosine), r = least over largest
// of their magnitudes. Minimax polynomial, error below 1.7e-6 rad. NaN without any amplitude.
template <typename F>
FRINGE_FUSION_INLINE F CyclesOf(const Fit<F>& fit) {
  const F sine = Magnitude(fit.sine);
  const F cosine = Magnitude(fit.cosine);
  const F r = Smaller(sine, cosine) / Larger(sine, cosine);
  const F r2 = r * r;
  F p = All<F>(-0.001865158381F);
  p = p * r2 + 0.008379086226F;
  p = p * r2 - 0.01852985011F;
  p = p * r2 + 0.03080290754F;
  p = p * r2 - 0.05293856724F;
  p = p * r2 + 0.1591513174F;
  F t = r * p;
  t = sine > cosine ? 0.25F - t : t;
  t = fit.cosine < 0.0F ? 0.5F - t : t;
  return TurnSign(t, fit.sine);
}

// Science 2.1: var phi = 2 sigma_I^2 / (N B^2), so N / 2 of it is (sigma_I / B)^2 of an equal even
// set.
template <typename F>
FRINGE_FUSION_INLINE MaskOf<F> IsStrong(F variance_rad2, float num_samples,
                                        const FitLimits& limits) {
  return 0.5F * limits.min_modulation2 * num_samples * variance_rad2 <= 1.0F;
}

// What a fit leaves for the row decoders.
FRINGE_FUSION_INLINE std::int32_t Store(const Fit<float>& fit, float num_samples, float peak,
                                        const FitArgs& args, const FitOut& out, int x) {
  out.cycles[x] = WrapToUnit(args.sign * CyclesOf(fit) - args.offset_cycles);
  out.variance[x] = kInverseTwoPi2 * fit.variance_rad2;
  out.offset[x] = fit.offset;
  out.amplitude2[x] = fit.amplitude2;
  std::int32_t status = fit.misfit <= fit.largest_misfit ? kRowValid : kRowResidual;
  status = IsStrong(fit.variance_rad2, num_samples, args.limits) ? status : kRowLowModulation;
  status = peak < args.limits.saturation_dn ? status : kRowSaturated;
  out.status[x] = status;
  return status;
}

// Three steps determine A, a and b: weights change nothing. Shot noise follows the fringe and with
// N = 3 its first harmonic does not cancel: var phi = 2/(3 B^2) (sigma_A^2 - gain B cos(3 phi) /
// 2).
template <typename F>
FRINGE_FUSION_INLINE Fit<F> FitThree(const F (&i)[4], const RowNoise& noise,
                                     const FitLimits& /*limits*/) {
  Fit<F> fit;
  fit.offset = (i[0] + i[1] + i[2]) * (1.0F / 3.0F);
  fit.cosine = (2.0F * i[0] - i[1] - i[2]) * (1.0F / 3.0F);
  fit.sine = (i[1] - i[2]) * 0.57735026919F;
  const F a = fit.cosine;
  fit.amplitude2 = a * a + fit.sine * fit.sine;
  const F inverse_b2 = 1.0F / Larger(fit.amplitude2, All<F>(kLeastAmplitude2));
  const F mean = noise.floor_dn2 + noise.gain_dn * fit.offset;
  const F third = 0.5F * noise.gain_dn * a * (4.0F * (a * a * inverse_b2) - 3.0F);
  fit.variance_rad2 = (2.0F / 3.0F) * Larger(mean - third, 0.25F * mean) * inverse_b2;
  fit.misfit = fit.largest_misfit = F{};
  return fit;
}

// Four steps leave one contrast z = (I0 - I1 + I2 - I3) / 4 that is noise alone. Shot noise
// correlates it with a and b; the weighted least squares takes that part out in closed form:
// a (1 - e), b (1 + e), e = gain z / sigma_A^2, with the covariance of the corrected values. e is
// small and never beyond +-1: B^2 of the plain fit serves as divisor of the corrected one. The
// squared residual is 4 z^2 / sigma_A^2. All is computed for 4 z, 4 A, 4 sigma_A^2, 2 a, 2 b.
template <typename F>
FRINGE_FUSION_INLINE Fit<F> FitFour(const F (&i)[4], const RowNoise& noise,
                                    const FitLimits& limits) {
  const F even = i[0] + i[2];
  const F odd = i[1] + i[3];
  const F sum = even + odd;
  const F z4 = even - odd;
  const F noise4 = 4.0F * noise.floor_dn2 + noise.gain_dn * sum;
  const F a = i[0] - i[2];
  const F b = i[1] - i[3];
  const F a2 = a * a;
  const F b2 = b * b;
  const F norm = a2 + b2;
  const F divisor = Larger(norm, All<F>(4.0F * kLeastAmplitude2));
  const F inverse = 1.0F / (noise4 * divisor);  // One division serves both quotients.
  const F e = noise.gain_dn * z4 * (divisor * inverse);
  const F gained = 4.0F * noise.gain_dn * noise.gain_dn * inverse * (a2 * b2);
  Fit<F> fit;
  fit.offset = 0.25F * sum;
  fit.cosine = a - a * e;
  fit.sine = b + b * e;
  fit.amplitude2 = 0.25F * norm;
  // B does not exceed A, so at most half of it is gained.
  fit.variance_rad2 = Larger(0.5F * noise4 - gained, 0.25F * noise4) * (noise4 * inverse);
  fit.misfit = z4 * z4;
  fit.largest_misfit = limits.max_residual2 * noise4 + 4.0F * limits.harmonic2 * divisor;
  return fit;
}

FRINGE_FUSION_INLINE std::int32_t FitThreeBody(const FitArgs& args, const FitOut& out, int count) {
  const float* __restrict i0 = args.frames[0];
  const float* __restrict i1 = args.frames[1];
  const float* __restrict i2 = args.frames[2];
  std::int32_t greatest = kRowValid;
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    const float grey[4] = {i0[x], i1[x], i2[x], 0.0F};
    const float peak = Larger(i0[x], Larger(i1[x], i2[x]));
    const Fit<float> fit = FitThree(grey, args.noise, args.limits);
    greatest = Larger(greatest, Store(fit, 3.0F, peak, args, out, x));
  }
  return greatest;
}

FRINGE_FUSION_INLINE std::int32_t FitFourBody(const FitArgs& args, const FitOut& out, int count) {
  const float* __restrict i0 = args.frames[0];
  const float* __restrict i1 = args.frames[1];
  const float* __restrict i2 = args.frames[2];
  const float* __restrict i3 = args.frames[3];
  std::int32_t greatest = kRowValid;
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    const float grey[4] = {i0[x], i1[x], i2[x], i3[x]};
    const float peak = Larger(Larger(i0[x], i1[x]), Larger(i2[x], i3[x]));
    const Fit<float> fit = FitFour(grey, args.noise, args.limits);
    greatest = Larger(greatest, Store(fit, 4.0F, peak, args, out, x));
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
    Fit<float> fit{};
    fit.offset = s.a[i];
    fit.cosine = s.b[i];
    fit.sine = s.c[i];
    fit.amplitude2 = s.b[i] * s.b[i] + s.c[i] * s.c[i];
    const float b2 = Larger(fit.amplitude2, kLeastAmplitude2);
    const float bb = s.b[i] * s.b[i] * s.vcc[i] + s.c[i] * s.c[i] * s.vbb[i];
    fit.variance_rad2 = Larger((bb - 2.0F * s.b[i] * s.c[i] * s.vbc[i]) / b2 / b2, kTiny);
    const float dof = Larger(r.count[i] - 3.0F, 0.0F);
    fit.misfit = r.chi2[i];
    fit.largest_misfit = args.limits.max_residual2 * dof +
                         args.limits.harmonic2 * b2 * r.weight[i] + (dof > 0.0F ? 0.0F : 1e30F);
    // Two shifts do not tell a phase.
    const float peak = r.places[i] >= 3.0F ? 0.0F : args.limits.saturation_dn;
    greatest = Larger(greatest, Store(fit, r.count[i], peak, args, out, begin + i));
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
