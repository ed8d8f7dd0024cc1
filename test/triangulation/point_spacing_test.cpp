#include "fringe_fusion/triangulation/point_spacing.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace fringe_fusion {
namespace {

RangeImage MakeGrid(int width, int height, float spacing_m) {
  RangeImage range = MakeRangeImage(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      range.points(x, y) =
          spacing_m * Eigen::Vector3f(static_cast<float>(x), static_cast<float>(y), 0) +
          Eigen::Vector3f(0, 0, 0.5F);
      range.normals(x, y) = Eigen::Vector3f(0, 0, -1);
      range.sigma_range(x, y) = 1e-5F;
      range.sigma_lateral(x, y) = 1e-5F;
    }
  }
  return range;
}

TEST(MedianPointSpacing, IsThePitchOfAGrid) {
  const RangeImage grid = MakeGrid(20, 10, 0.0005F);
  EXPECT_NEAR(MedianPointSpacing({&grid}), 0.0005, 1e-7);
}

TEST(MedianPointSpacing, IgnoresAGapInTheSurface) {
  RangeImage grid = MakeGrid(20, 10, 0.0005F);
  for (int y = 0; y < 10; ++y) {
    for (int x = 10; x < 20; ++x) grid.points(x, y).z() += 0.1F;
  }
  EXPECT_NEAR(MedianPointSpacing({&grid}), 0.0005, 1e-7);
}

TEST(MedianPointSpacing, GrowsWhereOnePixelInFourCarriesAPoint) {
  RangeImage grid = MakeGrid(80, 60, 0.0005F);
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 80; ++x) {
      if (x % 2 != 0 || y % 2 != 0) grid.points(x, y).setConstant(std::nanf(""));
    }
  }
  EXPECT_NEAR(MedianPointSpacing({&grid}), 0.001, 1.5e-4);
}

TEST(MedianPointSpacing, IsNanWithoutNeighbours) {
  const RangeImage empty = MakeRangeImage(4, 4);
  EXPECT_TRUE(std::isnan(MedianPointSpacing({&empty})));
  EXPECT_TRUE(std::isnan(MedianPointSpacing({})));
  RangeImage single = MakeRangeImage(4, 4);
  single.points(1, 1) = Eigen::Vector3f(0, 0, 1);
  EXPECT_TRUE(std::isnan(MedianPointSpacing({&single})));
}

}  // namespace
}  // namespace fringe_fusion
