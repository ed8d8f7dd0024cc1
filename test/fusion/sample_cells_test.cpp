#include "src/fusion/sample_cells.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace fringe_fusion {
namespace {

using internal::PackBlock;
using internal::PlacedSample;
using internal::Sample;
using internal::SampleSet;

// Points of a sphere in block (0, 0, 0), with weights.
std::vector<PlacedSample> SpherePatch(int count) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> slope(-0.25F, 0.25F);
  std::uniform_real_distribution<float> weight(0.5F, 2.0F);
  std::vector<PlacedSample> samples;
  for (int i = 0; i < count; ++i) {
    PlacedSample placed;
    placed.block = PackBlock(0, 0, 0);
    placed.sample.normal = Eigen::Vector3f(slope(random), slope(random), 1.0F).normalized();
    placed.sample.position = Eigen::Vector3f(4.0F, 4.0F, -8.0F) + 12.0F * placed.sample.normal;
    placed.sample.weight = weight(random);
    placed.sample.weight_variance = placed.sample.weight;
    samples.push_back(placed);
  }
  return samples;
}

// Every sum about a point, under a constant kernel.
std::array<double, 4> Sums(const std::vector<Sample>& samples, const Eigen::Vector3d& at) {
  std::array<double, 4> sums{};
  for (const Sample& sample : samples) {
    const auto w = static_cast<double>(sample.weight);
    const Eigen::Vector3d gap = sample.position.cast<double>() - at;
    sums[0] += w;
    sums[1] += w * gap.sum();
    sums[2] +=
        w * (gap.dot(sample.normal.cast<double>()) + static_cast<double>(sample.offset_normal));
    sums[3] += w * (gap.squaredNorm() + static_cast<double>(sample.offset_squared));
  }
  return sums;
}

TEST(SampleCells, KeepEverySum) {
  const std::vector<PlacedSample> points = SpherePatch(500);
  std::vector<Sample> plain;
  for (const PlacedSample& point : points) plain.push_back(point.sample);
  const Eigen::Vector3d at(3.0, 5.0, 4.2);
  const std::array<double, 4> expected = Sums(plain, at);
  SampleSet set = internal::MergeIntoCells(points, 0);
  for (int level = 0; level < internal::kMaxLevels; ++level) {
    if (level > 0) set = internal::Coarsen(set, level);
    EXPECT_LT(set.samples.size(), 500U >> level);
    const std::array<double, 4> sums = Sums(set.samples, at);
    for (std::size_t i = 0; i < sums.size(); ++i) {
      EXPECT_NEAR(sums[i], expected[i], 1e-4 * (1.0 + std::abs(expected[i]))) << level << " " << i;
    }
  }
}

TEST(SampleCells, OppositeSheetsStayApart) {
  std::vector<PlacedSample> samples(2);
  for (PlacedSample& placed : samples) {
    placed.block = PackBlock(1, 2, 3);
    placed.sample.position = {4.5F, 4.5F, 4.5F};
    placed.sample.weight = 1.0F;
  }
  samples[0].sample.normal = {0.0F, 0.0F, 1.0F};
  samples[1].sample.normal = {0.0F, 0.0F, -1.0F};
  EXPECT_EQ(internal::MergeIntoCells(samples, 2).samples.size(), 2U);
  samples[1].sample.normal = {0.0F, 0.1F, 0.99F};
  EXPECT_EQ(internal::MergeIntoCells(samples, 2).samples.size(), 1U);
}

TEST(SampleCells, RunsNameTheBlocksInOrder) {
  std::vector<PlacedSample> samples = SpherePatch(3);
  samples[0].block = PackBlock(0, 0, 7);
  samples[1].block = PackBlock(0, -1, 0);
  const SampleSet set = internal::MergeIntoCells(samples, 0);
  ASSERT_EQ(set.runs.size(), 4U);
  EXPECT_EQ(set.runs[0].block, PackBlock(0, -1, 0));
  EXPECT_EQ(set.runs[1].block, PackBlock(0, 0, 0));
  EXPECT_EQ(set.runs[2].block, PackBlock(0, 0, 7));
  EXPECT_EQ(set.runs[3].begin, 3U);
}

TEST(SampleCells, NothingFromNothing) {
  const SampleSet set = internal::MergeIntoCells({}, 0);
  EXPECT_TRUE(set.samples.empty());
  EXPECT_EQ(set.runs.size(), 1U);
}

}  // namespace
}  // namespace fringe_fusion
