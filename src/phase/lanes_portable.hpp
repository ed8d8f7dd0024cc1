#pragma once

// Four pixels at a time, in what every compiler for a 128-bit vector unit turns into instructions.

#include <cstdint>

namespace fringe_fusion::decode {

struct PortableLanes {
  using Float = float __attribute__((vector_size(16)));
  using Int = std::int32_t __attribute__((vector_size(16)));
  using Bytes = std::uint8_t __attribute__((vector_size(16)));
  using Words = std::uint16_t __attribute__((vector_size(16)));
  using Shorts = std::int16_t __attribute__((vector_size(16)));
  static constexpr int kCount = 4;

  static inline __attribute__((always_inline)) Float Load(const std::uint8_t* grey) {
    std::uint32_t four = 0;
    __builtin_memcpy(&four, grey, 4);
    const auto bytes = (Bytes)(Unsigned{four, 0, 0, 0});
    return Widen((Words)__builtin_shufflevector(bytes, Bytes{}, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20,
                                                5, 21, 6, 22, 7, 23));
  }
  static inline __attribute__((always_inline)) Float Load(const std::uint16_t* grey) {
    std::uint64_t four = 0;
    __builtin_memcpy(&four, grey, 8);
    return Widen((Words)(Pairs{four, 0}));
  }
  static inline __attribute__((always_inline)) Float Load(const std::int16_t* values) {
    std::uint64_t four = 0;
    __builtin_memcpy(&four, values, 8);
    const auto shorts = (Words)(Pairs{four, 0});
    const auto high = (Int)__builtin_shufflevector(Words{}, shorts, 0, 8, 1, 9, 2, 10, 3, 11);
    return __builtin_convertvector(high >> 16, Float);
  }
  static inline __attribute__((always_inline)) Shorts LoadShorts(const std::uint8_t* grey) {
    std::uint64_t eight = 0;
    __builtin_memcpy(&eight, grey, 8);
    const auto bytes = (Bytes)(Pairs{eight, 0});
    return (Shorts)__builtin_shufflevector(bytes, Bytes{}, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21,
                                           6, 22, 7, 23);
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
    const auto pairs = (Pairs)(mask & Int{1, 2, 4, 8});
    const std::uint64_t both = pairs[0] | pairs[1];
    return static_cast<std::int32_t>((both | (both >> 32)) & 15);
  }
  static inline __attribute__((always_inline)) bool All(Int mask) {
    const auto pairs = (Pairs)mask;
    return (pairs[0] & pairs[1]) == ~std::uint64_t{0};
  }
  static inline __attribute__((always_inline)) Int Truncate(Float x) {
    return __builtin_convertvector(x, Int);
  }
  // Values 0..255.
  static inline __attribute__((always_inline)) void StoreBytes(Int values, std::uint8_t* out) {
    const auto pairs = (Pairs)values;
    const Pairs packed = pairs | (pairs >> 24);
    const auto low = static_cast<std::uint16_t>(packed[0]);
    const auto high = static_cast<std::uint16_t>(packed[1]);
    __builtin_memcpy(out, &low, 2);
    __builtin_memcpy(out + 2, &high, 2);
  }
  // Every value 0..255 three times.
  static inline __attribute__((always_inline)) void StoreTriples(Int values, std::uint8_t* out) {
    const auto pairs = (Pairs)(values | (values << 8) | (values << 16));
    const Pairs packed = (pairs & 0xffffff) | ((pairs >> 8) & 0xffffff000000);
    __builtin_memcpy(out, &packed, 6);
    const std::uint64_t high = packed[1];
    __builtin_memcpy(out + 6, &high, 6);
  }

 private:
  using Unsigned = std::uint32_t __attribute__((vector_size(16)));
  using Pairs = std::uint64_t __attribute__((vector_size(16)));

  // The first four words. Interleaving with zeros widens on a little-endian machine.
  static inline __attribute__((always_inline)) Float Widen(Words words) {
    const auto values = (Int)__builtin_shufflevector(words, Words{}, 0, 8, 1, 9, 2, 10, 3, 11);
    return __builtin_convertvector(values, Float);
  }
};

}  // namespace fringe_fusion::decode
