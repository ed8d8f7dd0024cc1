#pragma once

#include <cmath>
#include <cstdint>
#include <initializer_list>

#include "common/constants.hpp"

namespace fringe_fusion::sim {

// Counter-based random numbers: a value is a pure function of what it is for (seed, pose, frame,
// pixel), never of the order or the thread in which it is asked for.
// Ref: Steele, Lea, Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014, fig. 17
// (constants of the mixing function by Stafford, variant 13).

/// What a random stream decides; keeps streams of equal indices apart.
enum class RandomUse : std::uint64_t {
  kPixelNoise = 1,
  kPoseError,
  kVibration,
  kFault,
  kGather,
  kLight
};

/// Bijective mixing of 64 bits.
inline std::uint64_t MixBits(std::uint64_t bits) {
  bits = (bits ^ (bits >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  bits = (bits ^ (bits >> 27U)) * 0x94d049bb133111ebULL;
  return bits ^ (bits >> 31U);
}

/// A stream of random numbers addressed by a counter.
class RandomStream {
 public:
  /// @param indices e.g. seed, pose index, frame index.
  RandomStream(RandomUse use, std::initializer_list<std::int64_t> indices)
      : key_(MixBits(static_cast<std::uint64_t>(use))) {
    for (const std::int64_t index : indices) {
      key_ = MixBits(key_ + kGolden * (static_cast<std::uint64_t>(index) + 1U));
    }
  }

  [[nodiscard]] std::uint64_t Bits(std::uint64_t counter) const {
    return MixBits(key_ + kGolden * (counter + 1U));
  }
  /// Uniform in (0, 1).
  [[nodiscard]] double Uniform(std::uint64_t counter) const {
    return (static_cast<double>(Bits(counter) >> 12U) + 0.5) * 0x1p-52;
  }
  /// Standard normal by Box and Muller; tails to 6.6 sigma.
  [[nodiscard]] float Gaussian(std::uint64_t counter) const {
    const std::uint64_t bits = Bits(counter);
    const float radius_uniform = (static_cast<float>(bits >> 40U) + 0.5F) * 0x1p-24F;
    const float angle_uniform = static_cast<float>((bits >> 8U) & 0xffffffU) * 0x1p-24F;
    // The half step can round up to 1 at the upper end, whose logarithm is 0: still valid.
    return std::sqrt(-2.0F * std::log(radius_uniform)) *
           std::cos(static_cast<float>(kTwoPi) * angle_uniform);
  }

 private:
  static constexpr std::uint64_t kGolden = 0x9e3779b97f4a7c15ULL;
  std::uint64_t key_;
};

}  // namespace fringe_fusion::sim
