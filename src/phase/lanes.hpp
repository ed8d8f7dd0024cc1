#pragma once

// What the kernels do with a number or with a short vector of numbers of the compiler: one source
// for every instruction set. Comparisons of vectors give masks of all ones or zeros.

#include <cstdint>

#define FRINGE_FUSION_INLINE static inline __attribute__((always_inline))

namespace fringe_fusion::decode {

/// What comparing two F gives.
template <typename F>
using MaskOf = decltype(F{} < F{});

template <typename F>
FRINGE_FUSION_INLINE F Larger(F a, F b) {
  return a > b ? a : b;
}
template <typename F>
FRINGE_FUSION_INLINE F Smaller(F a, F b) {
  return a < b ? a : b;
}

// The same value in every lane.
template <typename F>
FRINGE_FUSION_INLINE F All(float value) {
  return F{} + value;
}

template <typename Int>
FRINGE_FUSION_INLINE Int All(std::int32_t value) {
  return Int{} + value;
}

FRINGE_FUSION_INLINE float Magnitude(float x) { return __builtin_fabsf(x); }
template <typename F>
FRINGE_FUSION_INLINE F Magnitude(F x) {
  return (F)((MaskOf<F>)x & 0x7fffffff);
}

FRINGE_FUSION_INLINE float Root(float x) { return __builtin_sqrtf(x); }
template <typename F>
FRINGE_FUSION_INLINE F Root(F x) {
  F root;
  for (unsigned i = 0; i < sizeof(F) / sizeof(float); ++i) root[i] = __builtin_sqrtf(x[i]);
  return root;
}

// x with its sign turned where `sign` is negative.
FRINGE_FUSION_INLINE float TurnSign(float x, float sign) { return sign < 0.0F ? -x : x; }
template <typename F>
FRINGE_FUSION_INLINE F TurnSign(F x, F sign) {
  using Bits = MaskOf<F>;
  constexpr std::int32_t kSignBit = -0x7fffffff - 1;
  return (F)((Bits)x ^ ((Bits)sign & kSignBit));
}

// To the nearest integer, for |x| < 2^22.
template <typename F>
FRINGE_FUSION_INLINE F RoundToInteger(F x) {
  return (x + 12582912.0F) - 12582912.0F;
}

}  // namespace fringe_fusion::decode
