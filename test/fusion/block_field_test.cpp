#include "src/fusion/block_field.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "test/fusion/synthetic_views.hpp"

namespace fringe_fusion {
namespace {

using internal::kBlockSize;
using internal::PackBlock;
using internal::Voxel;

constexpr double kVoxel = 1e-3;
constexpr double kRadius = 0.016;

internal::FieldSettings Settings(int num_levels) { return {kVoxel, 2, num_levels, 3.0, 1.5}; }

internal::ViewSamples Samples(int id, const testing::Scene& scene, const Eigen::Vector3d& from) {
  FusionConfig config;
  config.voxel_m = kVoxel;
  const auto samples = internal::MakeViewSamples(
      testing::CastView(id, scene, from, testing::ViewSettings{}), config);
  EXPECT_TRUE(samples) << samples.error().message;
  return *samples;
}

Eigen::Vector3d VoxelPoint(const std::array<int, 3>& block, int i) {
  return kVoxel *
         Eigen::Vector3d(block[0] * 8 + i % 8, block[1] * 8 + i / 8 % 8, block[2] * 8 + i / 64);
}

TEST(BlockField, IsExactOnASphereAtEveryLevel) {
  const auto view = Samples(0, testing::SphereScene(kRadius), {0.0, 0.0, 0.12});
  const std::array<int, 3> block{0, 0, 1};  // z = 8 .. 15 mm: holds the cap near the axis
  const auto field = internal::MakeBlockField(PackBlock(0, 0, 1), {&view}, Settings(3));
  ASSERT_NE(field, nullptr);
  int num_wide = 0;
  for (int i = 0; i < internal::kVoxelsPerBlock; ++i) {
    const Voxel& voxel = field->voxels[static_cast<std::size_t>(i)];
    if (!(voxel.weight > 0.0F)) continue;
    const double truth = (VoxelPoint(block, i).norm() - kRadius) / kVoxel;
    EXPECT_NEAR(voxel.distance, truth, 0.003) << i;
    for (std::size_t level = 0; level < 2; ++level) {
      if (voxel.noise_ratio[level] == 0) continue;
      ++num_wide;
      EXPECT_NEAR(voxel.delta[level] / internal::kDeltaScale, 0.0F, 0.004F) << i;
      // Twice the width averages over four times the points.
      EXPECT_LT(voxel.noise_ratio[level] / internal::kRatioScale, 0.75F);
    }
  }
  EXPECT_GT(num_wide, 100);
}

TEST(BlockField, WideLevelsRoundAnEdge) {
  const auto view = Samples(0, testing::BoxScene({0.012, 0.012, 0.012}), {0.06, 0.0, 0.1});
  const auto field = internal::MakeBlockField(PackBlock(1, 0, 1), {&view}, Settings(3));
  ASSERT_NE(field, nullptr);
  float largest = 0.0F;
  for (const Voxel& voxel : field->voxels) {
    if (voxel.noise_ratio[1] == 0) continue;
    largest = std::max(largest, std::abs(static_cast<float>(voxel.delta[1])));
  }
  EXPECT_GT(largest / internal::kDeltaScale, 0.2F);
  float difference2 = 0.0F;
  for (const auto& cell : field->cells[1]) difference2 += cell.difference2;
  EXPECT_GT(difference2, 0.1F);
}

TEST(BlockField, IsNothingOutOfReach) {
  const auto view = Samples(0, testing::SphereScene(kRadius), {0.0, 0.0, 0.12});
  EXPECT_EQ(internal::MakeBlockField(PackBlock(9, 0, 0), {&view}, Settings(3)), nullptr);
  EXPECT_EQ(internal::MakeBlockField(PackBlock(0, 0, 1), {}, Settings(3)), nullptr);
}

TEST(BlockField, CountsTheViewsOfLevelZero) {
  const auto scene = testing::SphereScene(kRadius);
  const auto a = Samples(3, scene, {0.0, 0.0, 0.12});
  const auto b = Samples(5, scene, {0.02, 0.0, 0.12});
  const auto field = internal::MakeBlockField(PackBlock(0, 0, 1), {&a, &b}, Settings(1));
  ASSERT_NE(field, nullptr);
  // At the axis, which both views see; voxel (0, 0, z) is the first of its layer.
  for (int z = 6; z < kBlockSize; ++z) {
    const Voxel& voxel = field->voxels[static_cast<std::size_t>(z * kBlockSize * kBlockSize)];
    EXPECT_GT(voxel.weight, 0.0F);
    EXPECT_EQ(voxel.num_views, 2);
    EXPECT_EQ(voxel.noise_ratio[0], 0);
  }
}

}  // namespace
}  // namespace fringe_fusion
