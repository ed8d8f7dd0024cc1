#include "src/fusion/level_blend.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>

namespace fringe_fusion {
namespace {

using internal::BlockField;
using internal::kBlockSize;
using internal::kVoxelsPerBlock;
using internal::Voxel;

constexpr float kNoise = 0.1F;     // of level 0 [voxels]
constexpr float kVoxel_m = 1e-3F;  // one voxel

// A plane at z = 3.5; level 1 has half the noise of level 0 and differs by `delta` of x.
template <typename Delta>
std::unique_ptr<BlockField> Plane(Delta delta) {
  auto field = std::make_unique<BlockField>();
  for (int i = 0; i < kVoxelsPerBlock; ++i) {
    Voxel& voxel = field->voxels[static_cast<std::size_t>(i)];
    voxel.distance = static_cast<float>(i / (kBlockSize * kBlockSize)) - 3.5F;
    voxel.noise = kNoise;
    voxel.weight = 1.0F;
    const float difference = delta(i % kBlockSize);
    voxel.delta[0] = static_cast<std::int16_t>(std::lround(difference * internal::kDeltaScale));
    voxel.noise_ratio[0] = static_cast<std::uint16_t>(0.5F * internal::kRatioScale);
  }
  internal::CompareLevels(2, *field);
  return field;
}

internal::BlendedField Blend(const BlockField& field, int num_levels = 2) {
  internal::Neighborhood blocks{};
  blocks[13] = &field;
  return internal::BlendLevels(blocks, num_levels, static_cast<double>(kVoxel_m));
}

TEST(LevelBlend, TakesTheWideLevelWhereNoiseExplainsTheDifference) {
  const auto field = Plane([](int x) { return x % 2 == 0 ? 0.08F : -0.08F; });
  const internal::BlendedField blended = Blend(*field);
  for (std::size_t i = 0; i < blended.distance.size(); ++i) {
    const Voxel& voxel = field->voxels[i];
    const float wide = voxel.distance + static_cast<float>(voxel.delta[0]) / internal::kDeltaScale;
    ASSERT_NEAR(blended.distance[i], wide, 1e-6F);
    ASSERT_NEAR(blended.sigma[i], 0.5F * kNoise * kVoxel_m, 1e-8F);
  }
}

TEST(LevelBlend, TakesTheFineLevelWhereTheWideOneBends) {
  const auto field = Plane([](int) { return 1.0F; });
  const internal::BlendedField blended = Blend(*field);
  for (std::size_t i = 0; i < blended.distance.size(); ++i) {
    ASSERT_NEAR(blended.distance[i], field->voxels[i].distance, 0.01F);
    // The stated sigma owns up to the bias that the levels reveal.
    ASSERT_NEAR(blended.sigma[i], kVoxel_m, 0.1F * kVoxel_m);
  }
}

TEST(LevelBlend, IsSmoothBetweenTheTwo) {
  const auto field = Plane([](int x) { return 0.06F * static_cast<float>(x); });
  const internal::BlendedField blended = Blend(*field);
  for (int i = 1; i < kBlockSize; ++i) {
    const auto at = static_cast<std::size_t>(3 * kBlockSize * kBlockSize + i);
    EXPECT_LT(std::abs(blended.distance[at] - blended.distance[at - 1]), 0.06F) << i;
  }
}

TEST(LevelBlend, LeavesOneLevelAsItIs) {
  const auto field = Plane([](int) { return 0.0F; });
  const internal::BlendedField blended = Blend(*field, 1);
  EXPECT_EQ(blended.distance[5], field->voxels[5].distance);
  EXPECT_NEAR(blended.sigma[5], kNoise * kVoxel_m, 1e-9F);
}

TEST(LevelBlend, SharedSigmaIsNotAveragedAway) {
  auto field = Plane([](int) { return 0.0F; });
  for (Voxel& voxel : field->voxels) voxel.shared = 1.0F;
  EXPECT_NEAR(Blend(*field).sigma[7], std::hypot(1.0F, 0.5F * kNoise) * kVoxel_m, 1e-7F);
}

TEST(LevelBlend, UnsupportedVoxelsStayEmpty) {
  auto field = Plane([](int) { return 0.0F; });
  field->voxels[9] = Voxel{};
  const internal::BlendedField blended = Blend(*field);
  EXPECT_EQ(blended.distance[9], 0.0F);
  EXPECT_EQ(blended.sigma[9], 0.0F);
}

}  // namespace
}  // namespace fringe_fusion
