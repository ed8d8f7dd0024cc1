#pragma once

// Bodies of the kernels, inlined into one wrapper per instruction set. No standard library and no
// Eigen here: nothing compiled for AVX2 may end up in code that others share.

#include "kernels.hpp"

#define FRINGE_FUSION_INLINE static inline __attribute__((always_inline))

namespace fringe_fusion::decode {

constexpr std::int32_t kStatusLowModulation = 2;
constexpr std::int32_t kStatusSaturated = 3;
constexpr std::int32_t kStatusResidual = 5;
constexpr std::int32_t kStatusDoubtfulOrder = 6;
constexpr float kTiny = 1e-20F;

FRINGE_FUSION_INLINE float Larger(float a, float b) { return a > b ? a : b; }
FRINGE_FUSION_INLINE float Smaller(float a, float b) { return a < b ? a : b; }

// To the nearest integer, for |x| < 2^22.
FRINGE_FUSION_INLINE float RoundToInteger(float x) { return (x + 12582912.0F) - 12582912.0F; }

FRINGE_FUSION_INLINE float WrapToUnit(float cycles) {
  const float rest = cycles - RoundToInteger(cycles);
  return rest < 0.0F ? rest + 1.0F : rest;
}

// atan2(sine, cosine) / (2 pi). Ref: Abramowitz & Stegun 1964, 4.4.49, error below 2e-8 rad.
FRINGE_FUSION_INLINE float CyclesOf(float sine, float cosine) {
  const float s = __builtin_fabsf(sine);
  const float c = __builtin_fabsf(cosine);
  const float r = Smaller(s, c) / Larger(Larger(s, c), kTiny);
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
  t = s > c ? 0.25F - t : t;
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
  float variance_rad2;
  float residual;        // chi^2 / degrees of freedom
  float residual_limit;  // of the same
  float num_samples;
  float peak;
};

FRINGE_FUSION_INLINE void Store(const Fit& fit, const FitArgs& args, const FitOut& out, int x) {
  constexpr float kInverseTwoPi2 = 0.0253302959F;  // 1 / (2 pi)^2
  const float phase = args.sign * CyclesOf(fit.sine, fit.cosine) - args.offset_cycles;
  out.cycles[x] = WrapToUnit(phase);
  out.variance[x] = kInverseTwoPi2 * fit.variance_rad2;
  out.offset[x] = fit.offset;
  out.modulation[x] = __builtin_sqrtf(fit.cosine * fit.cosine + fit.sine * fit.sine);
  // Science 2.1: var phi = 2 sigma_I^2 / (N B^2), so this is (sigma_I / B)^2 of an equal even set.
  const float noise_ratio2 = 0.5F * fit.num_samples * fit.variance_rad2;
  std::int32_t status = fit.residual <= fit.residual_limit ? 0 : kStatusResidual;
  status = args.limits.min_modulation2 * noise_ratio2 <= 1.0F ? status : kStatusLowModulation;
  out.status[x] = fit.peak < args.limits.saturation_dn ? status : kStatusSaturated;
}

// Three steps determine A, a and b: weights change nothing. Shot noise follows the fringe and with
// N = 3 its first harmonic does not cancel: var phi = 2/(3 B^2) (sigma_A^2 - gain B cos(3 phi) /
// 2).
FRINGE_FUSION_INLINE void FitThreeBody(const FitArgs& args, const FitOut& out, int count) {
  const float* __restrict i0 = args.frames[0];
  const float* __restrict i1 = args.frames[1];
  const float* __restrict i2 = args.frames[2];
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    Fit fit{};
    fit.offset = (i0[x] + i1[x] + i2[x]) * (1.0F / 3.0F);
    fit.cosine = (2.0F * i0[x] - i1[x] - i2[x]) * (1.0F / 3.0F);
    fit.sine = (i1[x] - i2[x]) * 0.57735026919F;
    const float a = fit.cosine;
    const float b2 = Larger(a * a + fit.sine * fit.sine, kTiny);
    const float noise = args.noise.floor_dn2 + args.noise.gain_dn * fit.offset;
    const float third = 0.5F * args.noise.gain_dn * (4.0F * a * a * a / b2 - 3.0F * a);
    fit.variance_rad2 = (2.0F / 3.0F) * Larger(noise - third, 0.25F * noise) / b2;
    fit.num_samples = 3.0F;
    fit.peak = Larger(i0[x], Larger(i1[x], i2[x]));
    Store(fit, args, out, x);
  }
}

// Four steps leave one contrast z = (I0 - I1 + I2 - I3) / 4 that is noise alone. Shot noise
// correlates it with a and b; the weighted least squares takes that part out in closed form:
// a (1 - e), b (1 + e), e = gain z / sigma_A^2, with the covariance of the corrected values.
FRINGE_FUSION_INLINE void FitFourBody(const FitArgs& args, const FitOut& out, int count) {
  const float* __restrict i0 = args.frames[0];
  const float* __restrict i1 = args.frames[1];
  const float* __restrict i2 = args.frames[2];
  const float* __restrict i3 = args.frames[3];
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    Fit fit{};
    const float even = i0[x] + i2[x];
    const float odd = i1[x] + i3[x];
    fit.offset = 0.25F * (even + odd);
    const float z = 0.25F * (even - odd);
    const float noise = args.noise.floor_dn2 + args.noise.gain_dn * fit.offset;
    const float inverse_noise = 1.0F / noise;
    const float e = Larger(-0.5F, Smaller(0.5F, args.noise.gain_dn * z * inverse_noise));
    fit.cosine = 0.5F * (i0[x] - i2[x]) * (1.0F - e);
    fit.sine = 0.5F * (i1[x] - i3[x]) * (1.0F + e);
    const float a2 = fit.cosine * fit.cosine;
    const float s2 = fit.sine * fit.sine;
    const float inverse_b2 = 1.0F / Larger(a2 + s2, kTiny);
    const float gain2 = args.noise.gain_dn * args.noise.gain_dn;
    const float gained = gain2 * inverse_noise * (a2 * inverse_b2) * s2;
    fit.variance_rad2 = Larger(0.5F * noise - gained, 0.05F * noise) * inverse_b2;
    fit.residual = 4.0F * z * z * inverse_noise;
    fit.residual_limit =
        args.limits.max_residual2 + 4.0F * args.limits.harmonic2 * (a2 + s2) * inverse_noise;
    fit.num_samples = 4.0F;
    fit.peak = Larger(Larger(i0[x], i1[x]), Larger(i2[x], i3[x]));
    Store(fit, args, out, x);
  }
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

FRINGE_FUSION_INLINE void StoreBlock(const FitArgs& args, const FitOut& out, int begin, int count,
                                     const SolutionBlock& s, const ResidualBlock& r) {
#pragma GCC ivdep
  for (int i = 0; i < count; ++i) {
    Fit fit{};
    fit.offset = s.a[i];
    fit.cosine = s.b[i];
    fit.sine = s.c[i];
    const float b2 = Larger(s.b[i] * s.b[i] + s.c[i] * s.c[i], kTiny);
    const float bb = s.b[i] * s.b[i] * s.vcc[i] + s.c[i] * s.c[i] * s.vbb[i];
    fit.variance_rad2 = Larger((bb - 2.0F * s.b[i] * s.c[i] * s.vbc[i]) / b2 / b2, kTiny);
    const float dof = Larger(r.count[i] - 3.0F, 0.0F);
    fit.residual = r.chi2[i];
    fit.residual_limit = args.limits.max_residual2 * dof +
                         args.limits.harmonic2 * b2 * r.weight[i] + (dof > 0.0F ? 0.0F : 1e30F);
    fit.num_samples = r.count[i];
    // Two shifts do not tell a phase.
    fit.peak = r.places[i] >= 3.0F ? 0.0F : args.limits.saturation_dn;
    Store(fit, args, out, begin + i);
  }
}

// Science 2.7: one weighted least squares over all exposures; saturated samples have no weight.
FRINGE_FUSION_INLINE void FitWeightedBody(const FitArgs& args, const FitOut& out, int count) {
  NormalBlock sums;
  SolutionBlock fit;
  ResidualBlock residuals;
  for (int begin = 0; begin < count; begin += kBlock) {
    Accumulate<true>(args, begin, fit, sums);
    Solve(sums, fit);
    Accumulate<false>(args, begin, fit, sums);
    Solve(sums, fit);
    SumResiduals(args, begin, fit, residuals);
    const int length = count - begin < kBlock ? count - begin : kBlock;
    StoreBlock(args, out, begin, length, fit, residuals);
  }
}

// Science 2.3 and 2.4: the order of the finer set is the one nearest to the estimate so far. With a
// deviation of d fringes and its variance v, the next order deviates by 1 - d: log odds of the two
// (1 - 2 d) / (2 v). After a Gray code the estimate is an interval, whose next order lies `gap`
// outside: there the tail of the normal distribution is below exp(-z^2 / 2) / 2.
FRINGE_FUSION_INLINE void NestBody(const NestArgs& args, int count) {
  const float p = args.period_px;
  const float inverse_p = 1.0F / p;
  const float scale = args.open || args.interval ? 1.0F : 1.0F + args.period_before_px * inverse_p;
  const float systematic = args.phase_error * scale;
  const float systematic2 = systematic * systematic;
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    const float before = args.coordinate_px[x];
    const float wrapped = args.cycles[x] * p - 0.5F;
    const float q = (before - wrapped) * inverse_p;
    const float order = args.open ? 0.0F : RoundToInteger(q);
    const float unwrapped = wrapped + order * p;
    const float d = __builtin_fabsf(q - order);
    const float own = args.variance[x];
    const float v = args.variance_px2[x] * (inverse_p * inverse_p) + own + systematic2;
    const float half = args.half_px[x] * inverse_p;
    const float gap = Larger(1.0F - d - half, 0.0F);
    const float odds = args.interval ? 0.5F * gap * gap / own : 0.5F * (1.0F - 2.0F * d) / v;
    args.log_odds[x] = args.open ? args.log_odds[x] : Smaller(args.log_odds[x], odds);
    const float farthest =
        args.interval ? Larger(args.max_order_error, 1.01F * half + 4.0F * __builtin_sqrtf(own))
                      : args.max_order_error;
    const bool near = args.open || d <= farthest;
    const bool agrees =
        args.open || args.interval || d <= args.max_level_sigma * __builtin_sqrtf(v);
    std::int32_t status = args.status[x];
    status = status == 0 && !agrees ? kStatusResidual : status;
    args.status[x] =
        (status == 0 || status == kStatusResidual) && !near ? kStatusDoubtfulOrder : status;
    // Inverse variances; the first set replaces whatever stood there.
    const float own_px2 = own * (p * p);
    const float old_px2 = args.variance_px2[x];
    const bool first = args.open || args.interval;
    const float share = first ? 0.0F : own_px2 / (own_px2 + old_px2);
    args.coordinate_px[x] = first ? unwrapped : unwrapped + share * (before - unwrapped);
    args.variance_px2[x] = first ? own_px2 : share * old_px2;
  }
}

// Generalised least squares over the unknown error of the reference set (Sherman-Morrison).
FRINGE_FUSION_INLINE void JointCostBody(const JointArgs& args) {
  float* __restrict cost = args.cost;
  float* __restrict linear = args.scratch;
  for (int k = 0; k < args.num_candidates; ++k) cost[k] = linear[k] = 0.0F;
  for (int i = 0; i < args.num_sets; ++i) {
    const float* __restrict offsets = args.offsets + i * args.num_candidates;
    const float e = args.residuals[i];
    const float w = args.weights[i];
    const float ws = w * args.ratios[i];
#pragma GCC ivdep
    for (int k = 0; k < args.num_candidates; ++k) {
      float r = e - offsets[k];
      r -= RoundToInteger(r);
      cost[k] += w * r * r;
      linear[k] += ws * r;
    }
  }
#pragma GCC ivdep
  for (int k = 0; k < args.num_candidates; ++k) cost[k] -= args.coupling * linear[k] * linear[k];
}

}  // namespace fringe_fusion::decode
