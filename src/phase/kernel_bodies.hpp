#pragma once

// Bodies of the kernels that follow the fits: fringe orders, masks and the rows of the phase map.

#include "kernel_fits.hpp"

namespace fringe_fusion::decode {

FRINGE_FUSION_INLINE void NestOpenBody(const NestArgs& args, int count) {
  const float p = args.level.period_px;
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    args.coordinate_px[x] = args.cycles[x] * p - 0.5F;
    args.variance_px2[x] = args.variance[x] * args.level.period_px2;
  }
}

// After a Gray code the estimate is an interval, whose next order lies `gap` outside: there the
// tail of the normal distribution is below exp(-z^2 / 2) / 2.
FRINGE_FUSION_INLINE void NestIntervalBody(const NestArgs& args, int count) {
  const NestLevel& level = args.level;
  const float p = level.period_px;
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    const float wrapped = args.cycles[x] * p - 0.5F;
    const float q = (args.coordinate_px[x] - wrapped) * level.inverse_period;
    const float order = RoundToInteger(q);
    const float d = Magnitude(q - order);
    const float own = args.variance[x];
    const float half = args.half_px[x] * level.inverse_period;
    const float gap = Larger(1.0F - d - half, 0.0F);
    const float odds = 0.5F * gap * gap / own;
    const float beyond = Larger(d - 1.01F * half, 0.0F);
    const bool near = d <= level.max_order_error || beyond * beyond <= 16.0F * own;
    const bool certain = odds >= level.least_log_odds;
    args.status[x] =
        Larger<std::int32_t>(args.status[x], near && certain ? kRowValid : kRowDoubtfulOrder);
    if (args.log_odds != nullptr) args.log_odds[x] = Smaller(args.log_odds[x], odds);
    args.coordinate_px[x] = wrapped + order * p;
    args.variance_px2[x] = own * level.period_px2;
  }
}

/// An estimate after one more phase set.
template <typename F>
struct Nested {
  F coordinate_px;
  F variance_px2;
  F deviation;  // of the set from the estimate before [fringes]
  F variance;   // of the deviation
};

// Science 2.3 and 2.4: the order of the finer set, which is `own_px` but for whole periods, is the
// one nearest to the estimate so far. The two are fused by inverse variance.
template <typename F>
FRINGE_FUSION_INLINE Nested<F> NestOnce(F before_px, F before_px2, F own_px, F own_px2,
                                        const NestLevel& level) {
  Nested<F> out;
  const F periods = (before_px - own_px) * level.inverse_period;
  const F deviation = periods - RoundToInteger(periods);
  const F sum_px2 = own_px2 + before_px2;
  const F share = before_px2 / sum_px2;
  out.coordinate_px = before_px - share * (level.period_px * deviation);
  out.variance_px2 = share * own_px2;
  out.deviation = Magnitude(deviation);
  out.variance = sum_px2 * level.inverse_period2 + level.systematic2;
  return out;
}

// With a deviation of d fringes and its variance v, the next order deviates by 1 - d: log odds of
// the two (1 - 2 d) / (2 v).
template <typename F>
FRINGE_FUSION_INLINE MaskOf<F> IsCertain(const Nested<F>& nested, const NestLevel& level) {
  return nested.deviation <=
         Smaller(All<F>(level.max_order_error), 0.5F - level.least_log_odds * nested.variance);
}

template <typename F>
FRINGE_FUSION_INLINE MaskOf<F> Agrees(const Nested<F>& nested, const NestLevel& level) {
  return nested.deviation * nested.deviation <= level.farthest2 * nested.variance;
}

template <bool kReport>
FRINGE_FUSION_INLINE void NestStep(const NestArgs& args, int count) {
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    const float own_px = args.cycles[x] * args.level.period_px - 0.5F;
    const float own_px2 = args.variance[x] * args.level.period_px2;
    const Nested<float> nested =
        NestOnce(args.coordinate_px[x], args.variance_px2[x], own_px, own_px2, args.level);
    std::int32_t status = Agrees(nested, args.level) ? kRowValid : kRowResidual;
    status = IsCertain(nested, args.level) ? status : kRowDoubtfulOrder;
    args.status[x] = Larger<std::int32_t>(args.status[x], status);
    if (kReport) {
      const float odds = (0.5F - nested.deviation) / nested.variance;
      args.log_odds[x] = Smaller(args.log_odds[x], odds);
    }
    args.coordinate_px[x] = nested.coordinate_px;
    args.variance_px2[x] = nested.variance_px2;
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
// decides the side. Finer sets repeat over the size too, so only the fused value can tell.
template <typename F>
FRINGE_FUSION_INLINE F TurnIntoAxis(F coordinate_px, const AxisEnds& ends) {
  const F turns = (coordinate_px + 0.5F) * ends.inverse_size;
  return coordinate_px - ends.size_px * RoundToInteger(turns - 0.5F);
}

// Where the code repeats, a pixel close to the border may belong to the opposite one.
template <typename F>
FRINGE_FUSION_INLINE MaskOf<F> IsInside(F coordinate_px, F variance_px2, const AxisEnds& ends) {
  const F low = coordinate_px + 0.5F;
  const F nearest = Smaller(low, ends.size_px - low);
  return nearest * Magnitude(nearest) >= ends.margin2 * variance_px2;
}

FRINGE_FUSION_INLINE void CheckLightBody(const LightArgs& args, int count) {
  const float* bright = args.bright;
  const float* dark = args.dark;
  const float least_dark = args.has_black ? 2.0F * args.least : __builtin_inff();
#pragma GCC ivdep
  for (int x = 0; x < count; ++x) {
    const std::int32_t before = args.is_first ? kTooDark : args.light[x];
    const std::int32_t unlit = dark[x] >= least_dark ? kShadow : before;
    args.light[x] = bright[x] - dark[x] >= args.least ? 0 : (before == 0 ? 0 : unlit);
  }
}

/// Some lanes from pixel x on; the last pixels of a row may be fewer than lanes.
template <typename Lanes, bool kFull>
struct LaneAccess {
  using F = typename Lanes::Float;
  using Int = typename Lanes::Int;
  static constexpr int kCount = Lanes::kCount;
  int x;
  int count;

  template <typename Pixel>
  __attribute__((always_inline)) F LoadGrey(const Pixel* row) const {
    if (kFull) return Lanes::Load(row + x);
    Pixel some[kCount] = {};
    __builtin_memcpy(some, row + x, static_cast<unsigned>(count) * sizeof(Pixel));
    return Lanes::Load(some);
  }
  // Of rows with whole vectors.
  __attribute__((always_inline)) F Load(const float* row) const {
    F values;
    __builtin_memcpy(&values, row + x, sizeof(F));
    return values;
  }
  __attribute__((always_inline)) Int Load(const std::int32_t* row) const {
    Int values;
    __builtin_memcpy(&values, row + x, sizeof(Int));
    return values;
  }
  template <typename Vector, typename T>
  __attribute__((always_inline)) void Store(Vector values, T* row) const {
    __builtin_memcpy(row + x, &values, kFull ? sizeof(Vector) : static_cast<unsigned>(count) * 4U);
  }
  __attribute__((always_inline)) void StoreBytes(Int values, std::uint8_t* row) const {
    if (kFull) return Lanes::StoreBytes(values, row + x);
    std::uint8_t some[kCount];
    Lanes::StoreBytes(values, some);
    __builtin_memcpy(row + x, some, static_cast<unsigned>(count));
  }
};

// All rows have whole vectors.
template <typename Lanes>
FRINGE_FUSION_INLINE void FinishBody(const FinishArgs& given, int count) {
  using F = typename Lanes::Float;
  using Int = typename Lanes::Int;
  const FinishArgs args = given;  // of which the compiler knows that no store changes it
  for (int x = 0; x < count; x += Lanes::kCount) {
    const LaneAccess<Lanes, true> at{x, Lanes::kCount};
    const F coordinate = TurnIntoAxis(at.Load(args.coordinate_px), args.ends);
    at.Store(coordinate, args.coordinate_px);
    const auto inside = IsInside(coordinate, at.Load(args.variance_px2), args.ends);
    const Int status = inside ? Int{} : All<Int>(kRowOutside);
    at.Store(Larger(at.Load(args.status), status), args.status);
  }
}

// RowStatus as MaskReason.
template <typename Int>
FRINGE_FUSION_INLINE Int ReasonOf(Int status) {
  const auto map = [&](std::int32_t from, std::int32_t to, Int otherwise) {
    return status == from ? All<Int>(to) : otherwise;
  };
  Int reason = map(kRowOutside, kOutsideProjector, Int{});
  reason = map(kRowResidual, kResidual, reason);
  reason = map(kRowDoubtfulOrder, kDoubtfulOrder, reason);
  reason = map(kRowLowModulation, kLowModulation, reason);
  return map(kRowSaturated, kSaturated, reason);
}

template <typename Lanes, bool kFull>
FRINGE_FUSION_INLINE void ComposePixels(const ComposeArgs& args, int x, int count) {
  using F = typename Lanes::Float;
  using Int = typename Lanes::Int;
  const LaneAccess<Lanes, kFull> at{x, count};
  const MapRow& out = args.out;
  const F offset = 0.5F * (at.Load(args.u.offset) + at.Load(args.v.offset));
  const F modulation = Root(Smaller(at.Load(args.u.amplitude2), at.Load(args.v.amplitude2)));
  at.Store(offset, out.offset);
  at.Store(modulation, out.modulation);
  if (args.texture != nullptr) at.Store(offset + modulation, args.texture);
  // What is wrong with u explains the pixel before what is wrong with v.
  const Int u = at.Load(args.u.status);
  const Int light = at.Load(args.light);
  const Int reason = light != 0 ? light : ReasonOf(u != 0 ? u : at.Load(args.v.status));
  at.StoreBytes(reason, out.mask);
  const F nan = All<F>(__builtin_nanf(""));
  if (out.u_px != nullptr) {
    at.Store(reason == 0 ? at.Load(args.u.coordinate_px) : nan, out.u_px);
    at.Store(reason == 0 ? Root(at.Load(args.u.variance_px2)) : nan, out.sigma_u_px);
  }
  if (out.v_px != nullptr) {
    at.Store(reason == 0 ? at.Load(args.v.coordinate_px) : nan, out.v_px);
    at.Store(reason == 0 ? Root(at.Load(args.v.variance_px2)) : nan, out.sigma_v_px);
  }
}

template <typename Lanes>
FRINGE_FUSION_INLINE void ComposeBody(const ComposeArgs& given, int count) {
  const ComposeArgs args = given;  // of which the compiler knows that no store changes it
  int x = 0;
  for (; x + Lanes::kCount <= count; x += Lanes::kCount) {
    ComposePixels<Lanes, true>(args, x, Lanes::kCount);
  }
  if (x < count) ComposePixels<Lanes, false>(args, x, count - x);
}

// A grey value as a byte.
template <typename F>
FRINGE_FUSION_INLINE F ToByteRange(F grey, float full_scale) {
  const F byte = (255.0F / full_scale) * grey;
  return Smaller(Larger(byte, F{}), All<F>(255.0F)) + 0.5F;
}

FRINGE_FUSION_INLINE void ToRgbBody(const float* __restrict grey, float full_scale,
                                    std::uint8_t* __restrict rgb, int count) {
  for (int x = 0; x < count; ++x) {
    const float byte = ToByteRange(grey[x], full_scale);
    const auto value = static_cast<std::uint8_t>(static_cast<std::int32_t>(byte));
    rgb[3 * x] = value;
    rgb[3 * x + 1] = value;
    rgb[3 * x + 2] = value;
  }
}

template <typename Lanes>
FRINGE_FUSION_INLINE void BlankBody(const std::int32_t* light, const MapRow& given, int count) {
  using F = typename Lanes::Float;
  const MapRow out = given;  // of which the compiler knows that no store changes it
  const F nan = All<F>(__builtin_nanf(""));
  float* const rows[] = {out.u_px, out.v_px, out.sigma_u_px, out.sigma_v_px};
  int x = 0;
  for (; x + Lanes::kCount <= count; x += Lanes::kCount) {
    const LaneAccess<Lanes, true> at{x, Lanes::kCount};
    at.StoreBytes(at.Load(light), out.mask);
    for (float* row : rows) {
      if (row != nullptr) at.Store(nan, row);
    }
  }
  for (; x < count; ++x) {
    out.mask[x] = static_cast<std::uint8_t>(light[x]);
    for (float* row : rows) {
      if (row != nullptr) row[x] = __builtin_nanf("");
    }
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
