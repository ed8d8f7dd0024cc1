#pragma once

// The commonest sequence, nested phase sets of four even steps at one exposure, where nothing is
// wrong with a pixel: one pass from differences of grey values to the rows of the phase map.
// Groups of pixels of which one may be bad are marked for the other kernels.

#include "kernel_bodies.hpp"

namespace fringe_fusion::decode {

template <typename F>
FRINGE_FUSION_INLINE F Const(const float (&values)[kQuickGroup]) {
  F out;
  __builtin_memcpy(&out, __builtin_assume_aligned(values, 32), sizeof(F));
  return out;
}

// Sign bits and what they do: x with its sign turned where they are set.
template <typename F>
FRINGE_FUSION_INLINE MaskOf<F> SignOf(F x) {
  return (MaskOf<F>)x & (-0x7fffffff - 1);
}
template <typename F>
FRINGE_FUSION_INLINE F Turn(F x, MaskOf<F> sign) {
  return (F)((MaskOf<F>)x ^ sign);
}

// Whole vectors from x on; the last one of a stretch overlaps the one before.
template <typename Lanes, typename Pixel>
FRINGE_FUSION_INLINE void SubtractBody(const SubtractArgs& given, int count) {
  using Shorts = typename Lanes::Shorts;
  constexpr int kShorts = static_cast<int>(sizeof(Shorts) / sizeof(std::int16_t));
  const SubtractArgs args = given;  // of which the compiler knows that no store changes it
  const auto* const* frames = reinterpret_cast<const Pixel* const*>(args.frames);
  const Pixel* i0 = frames[0];
  const Pixel* i1 = frames[1];
  const Pixel* i2 = frames[2];
  const Pixel* i3 = frames[3];
  for (int begin = 0; begin < count; begin += kShorts) {
    const int x = Smaller(begin, count - kShorts);
    const Shorts g0 = Lanes::LoadShorts(i0 + x);
    const Shorts g1 = Lanes::LoadShorts(i1 + x);
    const Shorts g2 = Lanes::LoadShorts(i2 + x);
    const Shorts g3 = Lanes::LoadShorts(i3 + x);
    const auto store = [x](Shorts values, std::int16_t* row) {
      __builtin_memcpy(row + x, &values, sizeof(Shorts));
    };
    const Shorts even = g0 + g2;
    const Shorts odd = g1 + g3;
    const Shorts contrast = even - odd;
    store(g0 - g2, args.cosine);
    store(g1 - g3, args.sine);
    Shorts largest = Larger(contrast, -contrast);
    if (!args.is_first) {
      Shorts before;
      __builtin_memcpy(&before, args.largest + x, sizeof(Shorts));
      largest = Larger(largest, before);
    }
    store(largest, args.largest);
    if (args.contrast == nullptr) continue;
    store(contrast, args.contrast);
    store(even + odd, args.sum);
  }
}

/// What the sets of a vector of pixels have in common.
template <typename F>
struct QuickState {
  F coordinate_px;
  F weight;     // sum of (f / f of the finest)^2 4 B^2
  F least;      // 4 B^2 of all sets
  F greatest;   // the same
  F deviation;  // greatest of a set from the estimate before it [fringes]
};

// sign_px / (2 pi) times atan(difference / sum) in the quadrant of the signs, by a polynomial whose
// coefficients hold sign_px: atan(y / x) = pi / 4 + atan((y - x) / (y + x)).
template <int kTerms, typename F>
FRINGE_FUSION_INLINE F QuickCoordinate(F difference, F sum, MaskOf<F> cosine_sign,
                                       MaskOf<F> sine_sign, const QuickLevel& level) {
  const F s = difference / sum;
  const F s2 = s * s;
  F p = Const<F>(level.polynomial[kTerms - 1]);
  for (int i = kTerms - 2; i >= 0; --i) p = p * s2 + Const<F>(level.polynomial[i]);
  const F t = s * p - Const<F>(level.eighth_px);
  const F half = Turn(t, cosine_sign) + Const<F>(level.quarter_px);
  return Turn(half, sine_sign) - Const<F>(level.shift_px);
}

// Deviation of a set from the estimate before it [fringes].
template <typename F>
FRINGE_FUSION_INLINE F QuickDeviation(QuickState<F>& state, F own_px, const QuickLevel& level) {
  const F periods = (state.coordinate_px - own_px) * Const<F>(level.inverse_period);
  const F deviation = periods - RoundToInteger(periods);
  state.deviation = Larger(state.deviation, Magnitude(deviation));
  return deviation;
}

template <typename Lanes, bool kFirst>
FRINGE_FUSION_INLINE void QuickSet(const std::int16_t* rows, int stride, const QuickLevel& level,
                                   QuickState<typename Lanes::Float>& state) {
  using F = typename Lanes::Float;
  const F a = Lanes::Load(rows);
  const F b = Lanes::Load(rows + stride);
  const auto a_sign = SignOf(a);
  const auto b_sign = SignOf(b);
  const F cosine = Turn(a, a_sign);
  const F sine = Turn(b, b_sign);
  const F norm = a * a + b * b;
  const F own_px =
      QuickCoordinate<kQuickCoarseTerms>(sine - cosine, sine + cosine, a_sign, b_sign, level);
  const F weight = norm * Const<F>(level.weight);
  if (kFirst) {
    state.coordinate_px = own_px;
    state.weight = weight;
    state.least = state.greatest = norm;
    state.deviation = F{};
    return;
  }
  state.least = Smaller(state.least, norm);
  state.greatest = Larger(state.greatest, norm);
  const F deviation = QuickDeviation(state, own_px, level);
  state.weight = state.weight + weight;
  const F share = weight / state.weight;
  state.coordinate_px = state.coordinate_px - share * (Const<F>(level.period_px) * deviation);
}

/// The fused coordinate and what else the finest set tells.
template <typename F>
struct QuickResult {
  F variance_px2;
  F misfit;  // greatest of all sets
  F sum;     // 4 A
  F noise4;  // four times the noise variance of a grey value
  F norm;    // 4 B^2
};

// The weighted least squares of FitFour(), with one division for the angle and one for the fusion.
// var phi = X / (2 n N^2), X = n^2 N - 8 gain^2 a^2 b^2, n = 4 sigma_A^2, N = 4 B^2; the sets
// before have the information W / n in the same unit, so together (W X + n^2 N^2) / (n X).
template <typename Lanes>
FRINGE_FUSION_INLINE QuickResult<typename Lanes::Float> QuickFinest(
    const QuickArgs& args, const std::int16_t* rows, const QuickLevel& level,
    QuickState<typename Lanes::Float>& state) {
  using F = typename Lanes::Float;
  const F a = Lanes::Load(rows);
  const F b = Lanes::Load(rows + args.stride);
  const F gained = args.noise.gain_dn * Lanes::Load(rows + 3 * args.stride);
  QuickResult<F> out;
  out.sum = Lanes::Load(rows + 4 * args.stride);
  const F n = 4.0F * args.noise.floor_dn2 + args.noise.gain_dn * out.sum;
  const auto a_sign = SignOf(a);
  const auto b_sign = SignOf(b);
  const F cosine = Turn(a, a_sign);
  const F sine = Turn(b, b_sign);
  const F difference = sine - cosine;
  const F sum = sine + cosine;
  const F own_px = QuickCoordinate<kQuickTerms>(
      difference * n + gained * sum, sum * n + gained * difference, a_sign, b_sign, level);
  const F a2 = a * a;
  const F b2 = b * b;
  const F norm = a2 + b2;
  const F squared = n * norm;
  const F whole = n * squared;
  const float gain2 = 8.0F * args.noise.gain_dn * args.noise.gain_dn;
  const F spread = Larger(whole - gain2 * (a2 * b2), 0.5F * whole);
  const F information = squared * squared;
  const F inverse = 1.0F / (information + state.weight * spread);
  const F deviation = QuickDeviation(state, own_px, level);
  const F share = information * inverse;
  state.coordinate_px = state.coordinate_px - share * (Const<F>(level.period_px) * deviation);
  state.least = Smaller(state.least, norm);
  state.greatest = Larger(state.greatest, norm);
  out.variance_px2 = args.variance_px2 * (n * spread) * inverse;
  out.noise4 = n;
  out.norm = norm;
  out.misfit = Lanes::Load(rows + 2 * args.stride);
  return out;
}

// Conditions that suffice for a good pixel; the other kernels look at those that miss them.
template <typename Lanes>
FRINGE_FUSION_INLINE MaskOf<typename Lanes::Float> IsSurelyGood(
    const QuickArgs& args, const QuickState<typename Lanes::Float>& state,
    const QuickResult<typename Lanes::Float>& out, typename Lanes::Float sigma_px) {
  using F = typename Lanes::Float;
  const QuickLimits& limits = args.limits;
  const F n = out.noise4;
  const auto strong =
      state.least >= Larger(limits.least_norm_per_noise * n, All<F>(limits.least_norm));
  const auto fits =
      out.misfit * out.misfit <= limits.max_residual2 * n + 4.0F * limits.harmonic2 * state.least;
  const auto near = state.deviation <= limits.max_deviation;
  const auto agrees =
      state.greatest * (state.deviation * state.deviation - limits.agreed_deviation2) <=
      limits.agreed_deviation2_per_noise * n;
  const F low = state.coordinate_px + 0.5F;
  const auto inside = Smaller(low, args.size_px - low) >= limits.margin_sigma * sigma_px;
  return strong & fits & near & agrees & inside;
}

enum class QuickPart { kFirstAxis, kSecondAxis, kOnlyAxis };

// 4 A and 4 B^2 of one axis, to be kept for the other axis or stored with it.
template <typename Lanes, QuickPart kPart>
FRINGE_FUSION_INLINE void StoreLight(const QuickArgs& args, typename Lanes::Float sum4,
                                     typename Lanes::Float norm4, int x) {
  using F = typename Lanes::Float;
  const LaneAccess<Lanes, true> at{x, Lanes::kCount};
  if (kPart == QuickPart::kFirstAxis) {
    at.Store(sum4, args.other_axis);
    at.Store(norm4, args.other_axis + args.stride);
    return;
  }
  const bool both = kPart == QuickPart::kSecondAxis;
  const F offset = both ? 0.125F * (sum4 + at.Load(args.other_axis)) : 0.25F * sum4;
  const F least = both ? Smaller(norm4, at.Load(args.other_axis + args.stride)) : norm4;
  const F modulation = 0.5F * Root(least);
  at.Store(offset, args.offset);
  at.Store(modulation, args.modulation);
  if (args.rgb == nullptr) return;
  const F byte = ToByteRange(offset + modulation, args.full_scale);
  Lanes::StoreTriples(Lanes::Truncate(byte), args.rgb + 3 * static_cast<std::ptrdiff_t>(x));
}

template <typename Lanes, QuickPart kPart>
FRINGE_FUSION_INLINE MaskOf<typename Lanes::Float> QuickPixels(const QuickArgs& args, int x) {
  using F = typename Lanes::Float;
  QuickState<F> state;
  const QuickLevel* level = args.levels;
  const std::int16_t* rows = args.differences + x;
  // Else the compiler keeps the address of every constant in memory of its own.
  __asm__ volatile("" : "+r"(level));
  QuickSet<Lanes, true>(rows, args.stride, *level, state);
  for (int set = 2; set < args.num_sets; ++set) {
    ++level;
    rows += 2 * args.stride;
    QuickSet<Lanes, false>(rows, args.stride, *level, state);
  }
  const QuickResult<F> result = QuickFinest<Lanes>(args, rows + 2 * args.stride, level[1], state);
  const F sigma_px = Root(result.variance_px2);
  const LaneAccess<Lanes, true> at{x, Lanes::kCount};
  at.Store(state.coordinate_px, args.coordinate_px);
  at.Store(sigma_px, args.sigma_px);
  StoreLight<Lanes, kPart>(args, result.sum, result.norm, x);
  return IsSurelyGood<Lanes>(args, state, result, sigma_px);
}

template <typename Lanes, QuickPart kPart>
FRINGE_FUSION_INLINE void DarkRow(const QuickArgs& args, int count) {
  const std::int16_t* finest = args.differences + 2 * (args.num_sets - 1) * args.stride;
  for (int begin = 0; begin < count; begin += Lanes::kCount) {
    const int x = Smaller(begin, count - Lanes::kCount);
    const auto a = Lanes::Load(finest + x);
    const auto b = Lanes::Load(finest + args.stride + x);
    StoreLight<Lanes, kPart>(args, Lanes::Load(finest + 4 * args.stride + x), a * a + b * b, x);
  }
}

template <typename Lanes, QuickPart kPart>
FRINGE_FUSION_INLINE void QuickRow(const QuickArgs& given, int count) {
  const QuickArgs args = given;  // of which the compiler knows that no store changes it
  if (args.is_dark) {
    DarkRow<Lanes, kPart>(args, count);
    return;
  }
  for (int begin = 0; begin < count; begin += kQuickGroup) {
    const int x = Smaller(begin, count - kQuickGroup);
    auto good = QuickPixels<Lanes, kPart>(args, x);
    for (int i = Lanes::kCount; i < kQuickGroup; i += Lanes::kCount) {
      good &= QuickPixels<Lanes, kPart>(args, x + i);
    }
    if (!Lanes::All(good)) args.doubt[begin / kQuickGroup] = 1;
  }
}

template <typename Lanes>
FRINGE_FUSION_INLINE void QuickBody(const QuickArgs& args, int count) {
  if (args.offset == nullptr) {
    QuickRow<Lanes, QuickPart::kFirstAxis>(args, count);
  } else if (args.other_axis == nullptr) {
    QuickRow<Lanes, QuickPart::kOnlyAxis>(args, count);
  } else {
    QuickRow<Lanes, QuickPart::kSecondAxis>(args, count);
  }
}

// Groups in which white less black falls below the least contrast somewhere.
template <typename Pixel>
FRINGE_FUSION_INLINE void MarkUnlitBody(const UnlitArgs& args, int count) {
  const auto* white = static_cast<const Pixel*>(args.white);
  const auto* black = static_cast<const Pixel*>(args.black);
  for (int begin = 0; begin < count; begin += kQuickGroup) {
    const int x = Smaller(begin, count - kQuickGroup);
    std::int32_t least = 0x7fffffff;
    for (int i = x; i < x + kQuickGroup; ++i) {
      least = Smaller<std::int32_t>(least, white[i] - black[i]);
    }
    if (!(static_cast<float>(least) >= args.least_dn)) args.doubt[begin / kQuickGroup] = 1;
  }
}

// Two vectors at a time, in registers over all rows. Rows of at least two vectors.
template <typename Lanes, typename Pixel>
FRINGE_FUSION_INLINE std::int32_t PeakBody(const void* const* given, int num_rows, int count) {
  using Wide = decltype(Lanes::LoadWide(static_cast<const Pixel*>(nullptr)));
  constexpr int kWide = static_cast<int>(sizeof(Wide) / sizeof(Pixel));
  const auto* const* rows = reinterpret_cast<const Pixel* const*>(given);
  std::int32_t greatest = 0;
  if (count < 2 * kWide) {
    for (int i = 0; i < num_rows; ++i) {
      for (int x = 0; x < count; ++x) greatest = Larger<std::int32_t>(greatest, rows[i][x]);
    }
    return greatest;
  }
  Wide even = {};
  Wide odd = {};
  for (int begin = 0; begin < count; begin += 2 * kWide) {
    const int x = Smaller(begin, count - 2 * kWide);  // the last ones overlap those before
    for (int i = 0; i < num_rows; ++i) {
      even = Larger(even, Lanes::LoadWide(rows[i] + x));
      odd = Larger(odd, Lanes::LoadWide(rows[i] + x + kWide));
    }
  }
  even = Larger(even, odd);
  for (int i = 0; i < kWide; ++i) greatest = Larger<std::int32_t>(greatest, even[i]);
  return greatest;
}

}  // namespace fringe_fusion::decode
