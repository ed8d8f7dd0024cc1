#include "src/fusion/kernel_sums.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <random>
#include <vector>

namespace fringe_fusion {
namespace {

using internal::Channel;
using internal::kBlockSize;
using internal::KernelSums;
using internal::Sample;

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
  internal::AddToSums(sample, kKernelRadius, nullptr, internal::kAllLines, *sums);
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
  internal::AddToSums(sample, kKernelRadius, nullptr, line, *sums);
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
  internal::AddToSums(up, kKernelRadius, &sheets, internal::kAllLines, *sums);
  EXPECT_EQ(sums->weight.maxCoeff(), 0.0F);
  sheets[2].setConstant(0.25F);
  internal::AddToSums(up, kKernelRadius, &sheets, internal::kAllLines, *sums);
  // Half of full agreement.
  EXPECT_NEAR(sums->weight[Index(3, 3, 3)], 0.5 * 2.0 * Kernel(0.75), 1e-5);
}

// 512 numbers for each pointer, in the order of the members.
template <typename Channels>
Channels Point(std::vector<float>& numbers) {
  constexpr std::size_t kCount = sizeof(Channels) / sizeof(float*);
  std::array<float*, kCount> pointers{};
  for (std::size_t i = 0; i < kCount; ++i) {
    pointers[i] = numbers.data() + i * internal::kVoxelsPerBlock;
  }
  Channels channels{};
  std::memcpy(&channels, pointers.data(), sizeof(channels));
  return channels;
}

TEST(LineKernels, GiveTheSameBytesOnAnyProcessor) {
  constexpr std::size_t kSums = 13 * internal::kVoxelsPerBlock;
  constexpr std::size_t kSheets = 8 * internal::kVoxelsPerBlock;
  std::array<std::vector<float>, 2> sums{std::vector<float>(kSums), std::vector<float>(kSums)};
  std::array<std::vector<float>, 2> sheets{std::vector<float>(kSheets, 1e9F),
                                           std::vector<float>(kSheets, 1e9F)};
  std::mt19937 random(7);
  std::uniform_real_distribution<float> place(-4.0F, 11.0F);
  std::uniform_real_distribution<float> unit(-1.0F, 1.0F);
  std::vector<float> directions(3 * internal::kVoxelsPerBlock);
  for (float& component : directions) component = unit(random);
  const std::array<const float*, 3> normals{directions.data(),
                                            directions.data() + internal::kVoxelsPerBlock,
                                            directions.data() + 2 * internal::kVoxelsPerBlock};
  const std::array<const internal::LineKernels*, 2> kernels{&internal::PortableLineKernels(),
                                                            &internal::BestLineKernels()};
  for (int i = 0; i < 2000; ++i) {
    const internal::LineSample sample{{place(random), place(random), place(random)},
                                      {unit(random), unit(random), unit(random)},
                                      1.0F + unit(random),
                                      1.0F + unit(random),
                                      0.1F * unit(random),
                                      0.1F + 0.1F * unit(random),
                                      {7.0F, 80.0F, 200.0F}};
    const float radius = 3.5F + 2.5F * unit(random);
    for (std::size_t k = 0; k < 2; ++k) {
      kernels[k]->add_to_sums(sample, radius, i % 2 == 0 ? normals.data() : nullptr,
                              i % 3 == 0 ? 0x00FF00FF0F0F0F0FULL : internal::kAllLines,
                              Point<internal::SumChannels>(sums[k]));
      kernels[k]->add_to_sheets(sample, radius, Point<internal::SheetChannels>(sheets[k]));
    }
  }
  EXPECT_EQ(std::memcmp(sums[0].data(), sums[1].data(), kSums * sizeof(float)), 0);
  EXPECT_EQ(std::memcmp(sheets[0].data(), sheets[1].data(), kSheets * sizeof(float)), 0);
  EXPECT_GT(sums[0][internal::kVoxelsPerBlock / 2], 0.0F);
}

TEST(SheetNormals, TakeTheNearestSheet) {
  const auto up = MakeSample({3.5F, 3.5F, 4.5F}, {0.0F, 0.0F, 1.0F});
  const auto down = MakeSample({3.5F, 3.5F, 2.5F}, {0.0F, 0.0F, -1.0F});
  const auto sheets = std::make_unique<internal::SheetNormals>();
  internal::AddToSheets(up, kKernelRadius, *sheets);
  internal::AddToSheets(down, kKernelRadius, *sheets);
  const std::array<Channel, 3> consensus = sheets->Consensus();
  EXPECT_NEAR(consensus[2][Index(3, 3, 5)], 1.0F, 1e-6F);
  EXPECT_NEAR(consensus[2][Index(3, 3, 2)], -1.0F, 1e-6F);
  EXPECT_EQ(consensus[2][Index(0, 0, 0)], 0.0F);  // out of reach
}

}  // namespace
}  // namespace fringe_fusion
