#pragma once

// Eight pixels at a time. To be included where AVX2 is the target.

#include <immintrin.h>

#include <cstdint>

#include "lanes.hpp"

namespace fringe_fusion::decode {

struct AvxLanes {
  using Float = float __attribute__((vector_size(32)));
  using Int = std::int32_t __attribute__((vector_size(32)));
  using Bytes = std::uint8_t __attribute__((vector_size(32)));
  using Words = std::uint16_t __attribute__((vector_size(32)));
  using Shorts = std::int16_t __attribute__((vector_size(32)));
  static constexpr int kCount = 8;

  static inline __attribute__((always_inline)) Float Load(const std::uint8_t* grey) {
    const __m128i bytes = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(grey));
    return (Float)_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(bytes));
  }
  static inline __attribute__((always_inline)) Float Load(const std::uint16_t* grey) {
    const __m128i words = _mm_loadu_si128(reinterpret_cast<const __m128i*>(grey));
    return (Float)_mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(words));
  }
  static inline __attribute__((always_inline)) Float Load(const std::int16_t* values) {
    const __m128i shorts = _mm_loadu_si128(reinterpret_cast<const __m128i*>(values));
    return (Float)_mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(shorts));
  }
  static inline __attribute__((always_inline)) Shorts LoadShorts(const std::uint8_t* grey) {
    const __m128i bytes = _mm_loadu_si128(reinterpret_cast<const __m128i*>(grey));
    return (Shorts)_mm256_cvtepu8_epi16(bytes);
  }
  static inline __attribute__((always_inline)) Shorts LoadShorts(const std::uint16_t* grey) {
    Shorts shorts;
    __builtin_memcpy(&shorts, grey, sizeof(shorts));
    return shorts;
  }
  static inline __attribute__((always_inline)) Bytes LoadWide(const std::uint8_t* grey) {
    Bytes wide;
    __builtin_memcpy(&wide, grey, sizeof(wide));
    return wide;
  }
  static inline __attribute__((always_inline)) Words LoadWide(const std::uint16_t* grey) {
    Words wide;
    __builtin_memcpy(&wide, grey, sizeof(wide));
    return wide;
  }
  // Bit i is set where lane i is.
  static inline __attribute__((always_inline)) std::int32_t Bits(Int mask) {
    return _mm256_movemask_ps((__m256)mask);
  }
  static inline __attribute__((always_inline)) bool All(Int mask) {
    return _mm256_movemask_ps((__m256)mask) == 0xff;
  }
  static inline __attribute__((always_inline)) Int Truncate(Float x) {
    return (Int)_mm256_cvttps_epi32((__m256)x);
  }
  // Values 0..255.
  static inline __attribute__((always_inline)) void StoreBytes(Int values, std::uint8_t* out) {
    const auto all = (__m256i)values;
    const __m128i words =
        _mm_packs_epi32(_mm256_castsi256_si128(all), _mm256_extracti128_si256(all, 1));
    _mm_storel_epi64(reinterpret_cast<__m128i*>(out), _mm_packus_epi16(words, words));
  }
  // Every value 0..255 three times.
  static inline __attribute__((always_inline)) void StoreTriples(Int values, std::uint8_t* out) {
    const __m256i order =
        _mm256_setr_epi8(0, 0, 0, 4, 4, 4, 8, 8, 8, 12, 12, 12, -1, -1, -1, -1,  //
                         0, 0, 0, 4, 4, 4, 8, 8, 8, 12, 12, 12, -1, -1, -1, -1);
    const __m256i triples = _mm256_shuffle_epi8((__m256i)values, order);
    const __m128i low = _mm256_castsi256_si128(triples);
    const __m128i high = _mm256_extracti128_si256(triples, 1);
    __builtin_memcpy(out, &low, 12);
    __builtin_memcpy(out + 12, &high, 12);
  }
};

// The compiler takes two instructions for these where one side is a constant.
FRINGE_FUSION_INLINE AvxLanes::Float Larger(AvxLanes::Float a, AvxLanes::Float b) {
  return (AvxLanes::Float)_mm256_max_ps((__m256)a, (__m256)b);
}
FRINGE_FUSION_INLINE AvxLanes::Float Smaller(AvxLanes::Float a, AvxLanes::Float b) {
  return (AvxLanes::Float)_mm256_min_ps((__m256)a, (__m256)b);
}
FRINGE_FUSION_INLINE AvxLanes::Float Root(AvxLanes::Float x) {
  return (AvxLanes::Float)_mm256_sqrt_ps((__m256)x);
}
FRINGE_FUSION_INLINE AvxLanes::Float RoundToInteger(AvxLanes::Float x) {
  return (AvxLanes::Float)_mm256_round_ps((__m256)x, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
}

}  // namespace fringe_fusion::decode
