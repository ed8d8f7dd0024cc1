#pragma once

// The common sequence, phase sets of three or four even steps at one exposure: what the other
// kernels leave in rows between loading, fitting and nesting stays in registers here.

#include "kernel_bodies.hpp"

namespace fringe_fusion::decode {

template <int kSteps, typename F>
FRINGE_FUSION_INLINE Fit<F> FitSteps(const F (&grey)[4], const ClimbArgs& args) {
  if (kSteps == 3) return FitThree(grey, args.noise, args.limits);
  return FitFour(grey, args.noise, args.limits);
}

template <typename Lanes, typename Pixel, int kSteps, bool kFirst, bool kFull>
FRINGE_FUSION_INLINE void ClimbPixels(const ClimbArgs& args, int x, int count) {
  using F = typename Lanes::Float;
  using Int = typename Lanes::Int;
  const LaneAccess<Lanes, kFull> at{x, count};
  const LaneAccess<Lanes, true> whole{x, Lanes::kCount};
  F grey[4] = {};
  for (int i = 0; i < kSteps; ++i) grey[i] = at.LoadGrey(static_cast<const Pixel*>(args.frames[i]));
  const Fit<F> fit = FitSteps<kSteps>(grey, args);
  const F own_px = args.sign_px * CyclesOf(fit) - args.shift_px;
  const F own_px2 = kInverseTwoPi2 * args.level.period_px2 * fit.variance_rad2;
  Int status = fit.misfit <= fit.largest_misfit ? Int{} : All<Int>(kRowResidual);
  if (kFirst) {
    const AxisEnds period{args.level.period_px, args.level.inverse_period, 0.0F};
    whole.Store(TurnIntoAxis(own_px, period), args.coordinate_px);
    whole.Store(own_px2, args.variance_px2);
  } else {
    const Nested<F> nested = NestOnce(whole.Load(args.coordinate_px), whole.Load(args.variance_px2),
                                      own_px, own_px2, args.level);
    whole.Store(nested.coordinate_px, args.coordinate_px);
    whole.Store(nested.variance_px2, args.variance_px2);
    status = Agrees(nested, args.level) ? status : All<Int>(kRowResidual);
    status = IsCertain(nested, args.level) ? status : All<Int>(kRowDoubtfulOrder);
  }
  status = IsStrong(fit.variance_rad2, 1.0F * kSteps, args.limits) ? status
                                                                   : All<Int>(kRowLowModulation);
  whole.Store(kFirst ? status : Larger(whole.Load(args.status), status), args.status);
  if (args.offset == nullptr) return;
  whole.Store(fit.offset, args.offset);
  whole.Store(fit.amplitude2, args.amplitude2);
}

template <typename Lanes, typename Pixel, int kSteps, bool kFirst>
FRINGE_FUSION_INLINE void ClimbRow(const ClimbArgs& given, int count) {
  const ClimbArgs args = given;  // of which the compiler knows that no store changes it
  int x = 0;
  for (; x + Lanes::kCount <= count; x += Lanes::kCount) {
    ClimbPixels<Lanes, Pixel, kSteps, kFirst, true>(args, x, Lanes::kCount);
  }
  if (x < count) ClimbPixels<Lanes, Pixel, kSteps, kFirst, false>(args, x, count - x);
}

template <typename Lanes, typename Pixel>
FRINGE_FUSION_INLINE void ClimbBody(const ClimbArgs& args, int count) {
  if (args.num_steps == 3) {
    args.is_first ? ClimbRow<Lanes, Pixel, 3, true>(args, count)
                  : ClimbRow<Lanes, Pixel, 3, false>(args, count);
  } else {
    args.is_first ? ClimbRow<Lanes, Pixel, 4, true>(args, count)
                  : ClimbRow<Lanes, Pixel, 4, false>(args, count);
  }
}

// Two vectors at a time, so that least and greatest stay in registers over all rows.
template <typename Lanes, typename Pixel>
FRINGE_FUSION_INLINE std::int32_t RangeBody(const RangeArgs& args, int count) {
  using Wide = decltype(Lanes::LoadWide(static_cast<const Pixel*>(nullptr)));
  constexpr int kWide = static_cast<int>(sizeof(Wide) / sizeof(Pixel));
  const auto* const* rows = reinterpret_cast<const Pixel* const*>(args.rows);
  auto* lows = static_cast<Pixel*>(args.low);
  auto* highs = static_cast<Pixel*>(args.high);
  const int num_rows = args.num_rows;
  std::int32_t greatest = 0;
  if (count < 2 * kWide) {
    for (int x = 0; x < count; ++x) {
      lows[x] = highs[x] = rows[0][x];
      for (int i = 1; i < num_rows; ++i) {
        lows[x] = Smaller(lows[x], rows[i][x]);
        highs[x] = Larger(highs[x], rows[i][x]);
      }
      greatest = Larger<std::int32_t>(greatest, highs[x]);
    }
    return greatest;
  }
  Wide all = {};
  for (int begin = 0; begin < count; begin += 2 * kWide) {
    const int x = Smaller(begin, count - 2 * kWide);  // the last ones overlap those before
    Wide low0 = Lanes::LoadWide(rows[0] + x);
    Wide low1 = Lanes::LoadWide(rows[0] + x + kWide);
    Wide high0 = low0;
    Wide high1 = low1;
    for (int i = 1; i < num_rows; ++i) {
      const Wide next0 = Lanes::LoadWide(rows[i] + x);
      const Wide next1 = Lanes::LoadWide(rows[i] + x + kWide);
      low0 = Smaller(low0, next0);
      low1 = Smaller(low1, next1);
      high0 = Larger(high0, next0);
      high1 = Larger(high1, next1);
    }
    all = Larger(all, Larger(high0, high1));
    __builtin_memcpy(lows + x, &low0, sizeof(Wide));
    __builtin_memcpy(lows + x + kWide, &low1, sizeof(Wide));
    __builtin_memcpy(highs + x, &high0, sizeof(Wide));
    __builtin_memcpy(highs + x + kWide, &high1, sizeof(Wide));
  }
  for (int i = 0; i < kWide; ++i) greatest = Larger<std::int32_t>(greatest, all[i]);
  return greatest;
}

}  // namespace fringe_fusion::decode
