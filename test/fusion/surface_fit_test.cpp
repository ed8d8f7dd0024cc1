#include "src/fusion/surface_fit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "src/fusion/normal_noise.hpp"

namespace fringe_fusion {
namespace {

using internal::PointSums;
using internal::Surface;

// Sums over points of a sphere about `center`, seen from the origin; unequal weights, one-sided.
PointSums SphereSums(const Eigen::Vector3d& center, double radius) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> slope(-0.05, 0.15);
  PointSums sums;
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d n = Eigen::Vector3d(slope(random), slope(random), 1.0).normalized();
    const Eigen::Vector3d p = center + radius * n;
    const double w = 1.0 + 0.5 * std::sin(i);
    sums.weight += w;
    sums.offset += w * p;
    sums.normal += w * n;
    sums.offset_normal += w * p.dot(n);
    sums.offset_squared += w * p.squaredNorm();
  }
  return sums;
}

TEST(SphereSurface, IsExactOnASphere) {
  for (const double off : {-0.4, 0.0, 1.0}) {
    const Eigen::Vector3d center(0.0, 0.0, -20.0 - off);
    const Surface surface = internal::SphereSurface(SphereSums(center, 20.0));
    EXPECT_NEAR(surface.distance, off, 1e-5);
    EXPECT_NEAR(surface.gradient.z(), 1.0F, 1e-5F);
    // The plane of the mean normal is off by the sagitta.
    EXPECT_GT(
        std::abs(static_cast<double>(internal::PlaneSurface(SphereSums(center, 20.0)).distance) -
                 off),
        0.01);
  }
}

TEST(SphereSurface, IsAPlaneWhereThereIsNoSpread) {
  PointSums sums;
  sums.weight = 2.0;
  sums.offset = {0.0, 0.0, -1.0};
  sums.normal = {0.0, 0.0, 2.0};
  sums.offset_normal = -1.0;
  sums.offset_squared = 0.5;
  EXPECT_FLOAT_EQ(internal::SphereSurface(sums).distance, 0.5F);
  EXPECT_FLOAT_EQ(internal::PlaneSurface(sums).distance, 0.5F);
}

TEST(CentroidOffset, CountsAlongTheSurfaceOnly) {
  PointSums sums;
  sums.weight = 2.0;
  sums.offset = {2.0, 0.0, 6.0};
  sums.normal = {0.0, 0.0, 1.9};
  EXPECT_NEAR(internal::CentroidOffset(sums), 1.0, 1e-12);
  sums.normal.setConstant(std::nan(""));
  EXPECT_FALSE(internal::CentroidOffset(sums) <= 1e9);
}

// The kernel of science: noise of a flat part, normals from plane fits, order 2.
TEST(NormalNoiseFactor, LiesBetweenItsLimits) {
  EXPECT_EQ(internal::NormalNoiseFactor(0.0, 2), 1.0);
  // Slopes of single points: the kernel w (2 - r^2 / 2h^2), 2.5 times the variance for a Gaussian
  // without end.
  const double finest = internal::NormalNoiseFactor(0.1, 2);
  EXPECT_GT(finest, 1.8);
  EXPECT_LT(finest, 2.6);
  double last = finest;
  for (const double window : {0.5, 1.0, 2.0, 4.0}) {
    const double factor = internal::NormalNoiseFactor(window, 2);
    EXPECT_LT(factor, last) << window;
    EXPECT_GE(factor, 0.99) << window;
    last = factor;
  }
  EXPECT_FALSE(std::isnan(internal::NormalNoiseFactor(std::nan(""), 2)));
}

}  // namespace
}  // namespace fringe_fusion
