#pragma once

// Bodies of the kernels that follow the fits: fringe orders, masks and the rows of the phase map.

#include "kernel_fits.hpp"

namespace fringe_fusion::decode {

FRINGE_FUSION_INLINE void NestOpenBody(const NestArgs& args, int count) {
  const float p = args.period_px;
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    args.coordinate_px[x] = args.cycles[x] * p - 0.5F;
    args.variance_px2[x] = args.variance[x] * (p * p);
  }
}

// After a Gray code the estimate is an interval, whose next order lies `gap` outside: there the
// tail of the normal distribution is below exp(-z^2 / 2) / 2.
FRINGE_FUSION_INLINE void NestIntervalBody(const NestArgs& args, int count) {
  const float p = args.period_px;
  const float inverse_p = 1.0F / p;
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    const float wrapped = args.cycles[x] * p - 0.5F;
    const float q = (args.coordinate_px[x] - wrapped) * inverse_p;
    const float order = RoundToInteger(q);
    const float d = __builtin_fabsf(q - order);
    const float own = args.variance[x];
    const float half = args.half_px[x] * inverse_p;
    const float gap = Larger(1.0F - d - half, 0.0F);
    const float odds = 0.5F * gap * gap / own;
    const float beyond = Larger(d - 1.01F * half, 0.0F);
    const bool near = d <= args.max_order_error || beyond * beyond <= 16.0F * own;
    const bool certain = odds >= args.least_log_odds;
    args.status[x] = Larger(args.status[x], near && certain ? kRowValid : kRowDoubtfulOrder);
    if (args.log_odds != nullptr) args.log_odds[x] = Smaller(args.log_odds[x], odds);
    args.coordinate_px[x] = wrapped + order * p;
    args.variance_px2[x] = own * (p * p);
  }
}

// Science 2.3 and 2.4: the order of the finer set is the one nearest to the estimate so far. With a
// deviation of d fringes and its variance v, the next order deviates by 1 - d: log odds of the two
// (1 - 2 d) / (2 v). The estimates are fused by inverse variance.
template <bool kReport>
FRINGE_FUSION_INLINE void NestStep(const NestArgs& args, int count) {
  const float p = args.period_px;
  const float inverse_p = 1.0F / p;
  const float systematic = args.phase_error * (1.0F + args.period_before_px * inverse_p);
  const float systematic2 = systematic * systematic;
  const float farthest2 = args.max_level_sigma * args.max_level_sigma;
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    const float before = args.coordinate_px[x];
    const float wrapped = args.cycles[x] * p - 0.5F;
    const float q = (before - wrapped) * inverse_p;
    const float order = RoundToInteger(q);
    const float unwrapped = wrapped + order * p;
    const float d = __builtin_fabsf(q - order);
    const float own_px2 = args.variance[x] * (p * p);
    const float old_px2 = args.variance_px2[x];
    const float sum_px2 = own_px2 + old_px2;
    const float v = sum_px2 * (inverse_p * inverse_p) + systematic2;
    const bool near = d <= args.max_order_error && 0.5F - d >= args.least_log_odds * v;
    std::int32_t status = d * d <= farthest2 * v ? kRowValid : kRowResidual;
    status = near ? status : kRowDoubtfulOrder;
    args.status[x] = Larger(args.status[x], status);
    if (kReport) args.log_odds[x] = Smaller(args.log_odds[x], (0.5F - d) / v);
    const float share = own_px2 / sum_px2;
    args.coordinate_px[x] = unwrapped + share * (before - unwrapped);
    args.variance_px2[x] = share * old_px2;
  }
}

FRINGE_FUSION_INLINE void NestBody(const NestArgs& args, int count) {
  if (args.log_odds != nullptr) {
    NestStep<true>(args, count);
  } else {
    NestStep<false>(args, count);
  }
}

// The coarsest set of exactly one fringe jumps by the projector size at its ends, where noise
// decides the side. Finer sets repeat over the size too, so only the fused value can tell; a pixel
// closer than 3 sigma to the border may belong to the opposite one.
FRINGE_FUSION_INLINE void FinishBody(const FinishArgs& args, int count) {
  const float size = args.size_px;
  const float inverse_size = args.repeats ? 1.0F / size : 0.0F;
  const float margin2 = args.repeats ? 9.0F : 0.0F;
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    const float turns = (args.coordinate_px[x] + 0.5F) * inverse_size;
    const float coordinate = args.coordinate_px[x] - size * RoundToInteger(turns - 0.5F);
    args.coordinate_px[x] = coordinate;
    const float low = coordinate + 0.5F;
    const float high = size - low;
    const float nearest = Smaller(low, high);
    const float margin_px2 = margin2 * args.variance_px2[x];
    std::int32_t status = nearest * nearest >= margin_px2 ? kRowValid : kRowOutside;
    status = nearest >= 0.0F ? status : kRowOutside;
    args.status[x] = Larger(args.status[x], status);
  }
}

FRINGE_FUSION_INLINE void CheckLightBody(const LightArgs& args, int count) {
  const float* bright = args.bright;
  const float* dark = args.dark;
  const float least_dark = args.has_black ? 2.0F * args.least : __builtin_inff();
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    const std::int32_t before = args.light[x];
    const std::int32_t unlit = dark[x] >= least_dark ? kShadow : before;
    args.light[x] = bright[x] - dark[x] >= args.least ? 0 : (before == 0 ? 0 : unlit);
  }
}

// RowStatus as MaskReason.
FRINGE_FUSION_INLINE std::int32_t ReasonOf(std::int32_t status) {
  std::int32_t reason = status == kRowOutside ? 7 : 0;
  reason = status == kRowResidual ? 5 : reason;
  reason = status == kRowDoubtfulOrder ? 6 : reason;
  reason = status == kRowLowModulation ? 2 : reason;
  return status == kRowSaturated ? 3 : reason;
}

FRINGE_FUSION_INLINE void ComposeAxis(const AxisInput& in, const std::uint8_t* __restrict mask,
                                      float* __restrict value, float* __restrict sigma, int count) {
  const float nan = __builtin_nanf("");
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    const std::int32_t reason = mask[x];
    const float coordinate = in.coordinate_px[x];
    const float deviation = __builtin_sqrtf(in.variance_px2[x]);
    value[x] = reason == 0 ? coordinate : nan;
    sigma[x] = reason == 0 ? deviation : nan;
  }
}

FRINGE_FUSION_INLINE void ComposeBody(const ComposeArgs& args, int count) {
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    args.offset[x] = 0.5F * (args.u.offset[x] + args.v.offset[x]);
    args.modulation[x] = __builtin_sqrtf(Smaller(args.u.amplitude2[x], args.v.amplitude2[x]));
  }
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    // What is wrong with u explains the pixel before what is wrong with v.
    const std::int32_t u = ReasonOf(args.u.status[x]);
    const std::int32_t v = ReasonOf(args.v.status[x]);
    const std::int32_t light = args.light[x];
    const std::int32_t code = u != 0 ? u : v;
    args.mask[x] = static_cast<std::uint8_t>(light != 0 ? light : code);
  }
  if (args.u_px != nullptr) ComposeAxis(args.u, args.mask, args.u_px, args.sigma_u_px, count);
  if (args.v_px != nullptr) ComposeAxis(args.v, args.mask, args.v_px, args.sigma_v_px, count);
}

FRINGE_FUSION_INLINE void ToRgbBody(const float* __restrict grey, float full_scale,
                                    std::uint8_t* __restrict rgb, int count) {
  const float scale = 255.0F / full_scale;
  for (int x = 0; x < count; ++x) {
    const float byte = Smaller(Larger(scale * grey[x], 0.0F), 255.0F);
    const auto value = static_cast<std::uint8_t>(static_cast<std::int32_t>(byte + 0.5F));
    rgb[3 * x] = value;
    rgb[3 * x + 1] = value;
    rgb[3 * x + 2] = value;
  }
}

FRINGE_FUSION_INLINE void RatioBody(const float* __restrict modulation,
                                    const float* __restrict offset,
                                    const std::uint8_t* __restrict mask, float* __restrict ratio,
                                    int count) {
  for (int x = 0; x < count; ++x) {
    const float value = modulation[x] / Larger(offset[x], kTiny);
    ratio[x] = mask[x] == 0 ? value : 0.0F;
  }
}

// A pixel is a spike where both neighbours along one direction differ by more than the step; a
// missing one counts as different, two missing ones tell nothing. NaN compares false.
FRINGE_FUSION_INLINE std::int32_t JumpsOnBothSides(float here, float before, float after,
                                                   float step) {
  const std::int32_t near_before = __builtin_fabsf(here - before) <= step ? 1 : 0;
  const std::int32_t near_after = __builtin_fabsf(here - after) <= step ? 1 : 0;
  const std::int32_t has_before = before == before ? 1 : 0;
  const std::int32_t has_after = after == after ? 1 : 0;
  return (has_before | has_after) & (1 - (near_before | near_after));
}

// B / A does not depend on the albedo: a texture edge stays and a blend of two phases falls.
FRINGE_FUSION_INLINE void FindMixed(const EdgeArgs& args, int count) {
  const float* __restrict r0 = args.ratio[0];
  const float* __restrict r1 = args.ratio[1];
  const float* __restrict r2 = args.ratio[2];
  std::int32_t* __restrict found = args.found;
#pragma GCC ivdep
  for (int x = 1; x < count - 1; ++x) {
    const float here = r1[x];
    const float sum = r0[x - 1] + r0[x] + r0[x + 1] + r1[x - 1] + here + r1[x + 1] + r2[x - 1] +
                      r2[x] + r2[x + 1];
    const float above = (r0[x - 1] > 0.0F ? 1.0F : 0.0F) + (r0[x] > 0.0F ? 1.0F : 0.0F) +
                        (r0[x + 1] > 0.0F ? 1.0F : 0.0F);
    const float beside = (r1[x - 1] > 0.0F ? 1.0F : 0.0F) + (here > 0.0F ? 1.0F : 0.0F) +
                         (r1[x + 1] > 0.0F ? 1.0F : 0.0F);
    const float below = (r2[x - 1] > 0.0F ? 1.0F : 0.0F) + (r2[x] > 0.0F ? 1.0F : 0.0F) +
                        (r2[x + 1] > 0.0F ? 1.0F : 0.0F);
    found[x] = here * (above + beside + below) < args.least_ratio * sum ? 1 : 0;
  }
}

FRINGE_FUSION_INLINE void FindSpikes(const float* const* rows, float step,
                                     std::int32_t* __restrict found, int count) {
  const float* __restrict above = rows[0];
  const float* __restrict here = rows[1];
  const float* __restrict below = rows[2];
#pragma GCC ivdep
  for (int x = 1; x < count - 1; ++x) {
    found[x] |= JumpsOnBothSides(here[x], here[x - 1], here[x + 1], step) |
                JumpsOnBothSides(here[x], above[x], below[x], step);
  }
}

FRINGE_FUSION_INLINE void FindEdgesBody(const EdgeArgs& args, int count) {
  FindMixed(args, count);
  if (args.u[1] != nullptr) FindSpikes(args.u, args.max_step_px, args.found, count);
  if (args.v[1] != nullptr) FindSpikes(args.v, args.max_step_px, args.found, count);
  const float* __restrict ratio = args.ratio[1];
  for (int x = 1; x < count - 1; ++x) {
    const std::int32_t valid = ratio[x] > 0.0F ? 1 : 0;
    args.edges[x] = static_cast<std::uint8_t>(args.found[x] & valid);
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
