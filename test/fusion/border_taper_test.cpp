#include "src/fusion/border_taper.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace fringe_fusion {
namespace {

constexpr float kSpacing = 1e-3F;

// A plane facing the camera; columns from `step_at` on lie `step_m` behind.
RangeImage Stairs(int width, int height, int step_at, float step_m) {
  RangeImage range = MakeRangeImage(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const float z = x < step_at ? 0.3F : 0.3F + step_m;
      range.points(x, y) = {kSpacing * static_cast<float>(x), kSpacing * static_cast<float>(y), z};
      range.normals(x, y) = {0.0F, 0.0F, -1.0F};
      range.sigma_range(x, y) = range.sigma_lateral(x, y) = 1e-5F;
    }
  }
  return range;
}

float Smoothstep(float t) { return t * t * (3.0F - 2.0F * t); }

TEST(BorderTaper, FadesTowardsTheImageBorder) {
  const Image<float> taper = internal::BorderTaper(Stairs(40, 30, 40, 0.0F), 5.0, 1e-3);
  EXPECT_NEAR(taper(0, 15), Smoothstep(1.0F / 6.0F), 0.01F);
  EXPECT_NEAR(taper(2, 15), Smoothstep(3.0F / 6.0F), 0.01F);
  EXPECT_FLOAT_EQ(taper(20, 15), 1.0F);
  for (int x = 1; x < 20; ++x) EXPECT_GE(taper(x, 15), taper(x - 1, 15)) << x;
}

TEST(BorderTaper, FadesTowardsADepthStepAndNotAlongASlope) {
  const RangeImage stairs = Stairs(40, 30, 20, 0.002F);
  const Image<float> taper = internal::BorderTaper(stairs, 5.0, 1e-3);
  EXPECT_LT(taper(19, 15), 0.1F);
  EXPECT_LT(taper(20, 15), 0.1F);
  EXPECT_FLOAT_EQ(taper(10, 15), 1.0F);
  // The same step within the limit is no border.
  EXPECT_FLOAT_EQ(internal::BorderTaper(stairs, 5.0, 3e-3)(19, 15), 1.0F);
}

TEST(BorderTaper, FadesAroundAHole) {
  RangeImage range = Stairs(40, 30, 40, 0.0F);
  range.points(20, 15).setConstant(std::numeric_limits<float>::quiet_NaN());
  const Image<float> taper = internal::BorderTaper(range, 5.0, 1e-3);
  EXPECT_LT(taper(21, 15), 0.1F);
  EXPECT_GT(taper(21, 15), 0.0F);
  EXPECT_FLOAT_EQ(taper(27, 15), 1.0F);
}

TEST(BorderTaper, DropsSpikesAndFadesNothingForThem) {
  RangeImage range = Stairs(40, 30, 40, 0.0F);
  range.points(20, 15).z() += 0.01F;
  for (const double taper_px : {0.0, 5.0}) {
    const Image<float> taper = internal::BorderTaper(range, taper_px, 1e-3);
    EXPECT_EQ(taper(20, 15), 0.0F);
    EXPECT_FLOAT_EQ(taper(21, 15), 1.0F);
  }
  // A rib of one pixel stays.
  for (int y = 0; y < 30; ++y) range.points(20, y).z() = 0.31F;
  EXPECT_GT(internal::BorderTaper(range, 5.0, 1e-3)(20, 15), 0.0F);
}

TEST(BorderTaper, IsOneWhenSwitchedOffOrWithoutStructure) {
  EXPECT_FLOAT_EQ(internal::BorderTaper(Stairs(40, 30, 40, 0.0F), 0.0, 1e-3)(0, 0), 1.0F);
  EXPECT_FLOAT_EQ(internal::BorderTaper(Stairs(40, 1, 40, 0.0F), 5.0, 1e-3)(0, 0), 1.0F);
}

TEST(PointSpacing, IsTheMedianOfTheWiderDirection) {
  RangeImage range = Stairs(40, 30, 40, 0.0F);
  EXPECT_NEAR(internal::PointSpacing(range), 1e-3, 1e-7);
  for (Eigen::Vector3f& point : range.points) point.y() *= 2.0F;
  EXPECT_NEAR(internal::PointSpacing(range), 2e-3, 1e-7);
  EXPECT_EQ(internal::PointSpacing(Stairs(40, 1, 40, 0.0F)), 0.0);
  EXPECT_EQ(internal::PointSpacing(MakeRangeImage(10, 10)), 0.0);
}

}  // namespace
}  // namespace fringe_fusion
