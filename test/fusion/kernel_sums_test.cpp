#include "src/fusion/kernel_sums.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

namespace fringe_fusion {
namespace {

using internal::Channel;
using internal::kBlockSize;
using internal::KernelSums;
using internal::Sample;
using internal::SampleKernel;

constexpr float kKernelRadius = 3.0F;

Sample MakeSample(const Eigen::Vector3f& position, const Eigen::Vector3f& normal) {
  Sample sample;
  sample.position = position;
  sample.normal = normal.normalized();
  sample.weight = 2.0F;
  sample.weight_variance = 0.5F;
  sample.color = Rgb8{10, 20, 30};
  return sample;
}

int Index(int x, int y, int z) { return (z * kBlockSize + y) * kBlockSize + x; }

double Kernel(double distance2) {
  const double h = static_cast<double>(kKernelRadius) / 2.5;
  const double taper = 1.0 - distance2 / static_cast<double>(kKernelRadius * kKernelRadius);
  return taper > 0.0 ? std::exp(-distance2 / (2.0 * h * h)) * taper * taper : 0.0;
}

TEST(KernelSums, HoldEachMomentOfASample) {
  const Sample sample = MakeSample({3.25F, 4.5F, 2.75F}, {0.2F, -0.3F, 0.9F});
  const auto sums = std::make_unique<KernelSums>();
  internal::AddToSums(SampleKernel(sample, kKernelRadius), nullptr, internal::kAllLines, *sums);
  for (int z = 0; z < kBlockSize; ++z) {
    for (int y = 0; y < kBlockSize; ++y) {
      for (int x = 0; x < kBlockSize; ++x) {
        const int i = Index(x, y, z);
        const Eigen::Vector3d gap = sample.position.cast<double>() - Eigen::Vector3d(x, y, z);
        const double k = Kernel(gap.squaredNorm());
        const double w = 2.0 * k;
        const Eigen::Vector3d n = sample.normal.cast<double>();
        ASSERT_NEAR(sums->weight[i], w, 1e-6);
        ASSERT_NEAR(sums->offset[1][i], w * gap.y(), 1e-6);
        ASSERT_NEAR(sums->normal[2][i], w * n.z(), 1e-6);
        ASSERT_NEAR(sums->offset_normal[i], w * gap.dot(n), 1e-6);
        ASSERT_NEAR(sums->offset_squared[i], w * gap.squaredNorm(), 3e-6);
        ASSERT_NEAR(sums->variance[i], k * k * 0.5, 1e-6);
        ASSERT_NEAR(sums->color[2][i], w * 30.0, 1e-4);
      }
    }
  }
}

TEST(KernelSums, AddOnlyTheWantedLines) {
  const Sample sample = MakeSample({3.5F, 3.5F, 3.5F}, {0.0F, 0.0F, 1.0F});
  const auto sums = std::make_unique<KernelSums>();
  const internal::LineMask line = internal::LineMask{1} << (4 * kBlockSize + 3);  // y = 3, z = 4
  internal::AddToSums(SampleKernel(sample, kKernelRadius), nullptr, line, *sums);
  EXPECT_GT(sums->weight[Index(3, 3, 4)], 0.0F);
  EXPECT_EQ(sums->weight[Index(3, 4, 4)], 0.0F);
  EXPECT_EQ(sums->weight[Index(3, 3, 3)], 0.0F);
}

TEST(KernelSums, LeaveOutTheOtherSheet) {
  const auto up = MakeSample({3.5F, 3.5F, 3.5F}, {0.0F, 0.0F, 1.0F});
  std::array<Channel, 3> sheets;
  for (auto& channel : sheets) channel.setZero();
  sheets[2].setConstant(-1.0F);
  const auto sums = std::make_unique<KernelSums>();
  internal::AddToSums(SampleKernel(up, kKernelRadius), &sheets, internal::kAllLines, *sums);
  EXPECT_EQ(sums->weight.maxCoeff(), 0.0F);
  sheets[2].setConstant(0.25F);
  internal::AddToSums(SampleKernel(up, kKernelRadius), &sheets, internal::kAllLines, *sums);
  // Half of full agreement.
  EXPECT_NEAR(sums->weight[Index(3, 3, 3)], 0.5 * 2.0 * Kernel(0.75), 1e-5);
}

TEST(SheetNormals, TakeTheNearestSheet) {
  const auto up = MakeSample({3.5F, 3.5F, 4.5F}, {0.0F, 0.0F, 1.0F});
  const auto down = MakeSample({3.5F, 3.5F, 2.5F}, {0.0F, 0.0F, -1.0F});
  const auto sheets = std::make_unique<internal::SheetNormals>();
  internal::AddToSheets(SampleKernel(up, kKernelRadius), *sheets);
  internal::AddToSheets(SampleKernel(down, kKernelRadius), *sheets);
  const std::array<Channel, 3> consensus = sheets->Consensus();
  EXPECT_NEAR(consensus[2][Index(3, 3, 5)], 1.0F, 1e-6F);
  EXPECT_NEAR(consensus[2][Index(3, 3, 2)], -1.0F, 1e-6F);
  EXPECT_EQ(consensus[2][Index(0, 0, 0)], 0.0F);  // out of reach
}

}  // namespace
}  // namespace fringe_fusion
