#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "analytic_view.hpp"

namespace fringe_fusion {
namespace {

constexpr double kDegPerRad = 180.0 / M_PI;

// An organised cloud of a surface given by its depth along the rays of a simple camera.
RangeImage MakeCloud(const test::DepthOfRay& depth, double noise_m, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> unit;
  RangeImage range = MakeRangeImage(120, 100);
  for (int y = 0; y < range.height; ++y) {
    for (int x = 0; x < range.width; ++x) {
      const Eigen::Vector2d ray((x - 60) / 300.0, (y - 50) / 300.0);
      const double z = depth(ray) + noise_m * unit(engine);
      range.points(x, y) = (z * ray.homogeneous()).cast<float>();
      range.sigma_range(x, y) = static_cast<float>(std::max(noise_m, 1e-7));
      range.sigma_lateral(x, y) = 1e-4F;
    }
  }
  return range;
}

TEST(EstimateNormals, PlaneIsExactAndFacesTheCamera) {
  const Eigen::Vector3d normal = Eigen::Vector3d(-0.6, 0.3, 1.0).normalized();
  const RangeImage out = EstimateNormals(MakeCloud(test::PlaneDepth(normal, 0.5), 0.0, 1), {});
  EXPECT_EQ(CountValid(out), 120 * 100);
  for (const Eigen::Vector3f& n : out.normals) {
    ASSERT_NEAR(n.cast<double>().dot(-normal), 1.0, 1e-6);
  }
}

TEST(EstimateNormals, SphereWithinCurvature) {
  const Eigen::Vector3d centre(0.0, 0.0, 0.6);
  const auto sphere = [&](const Eigen::Vector2d& ray) {
    const Eigen::Vector3d r = ray.homogeneous();
    const double a = r.squaredNorm();
    const double b = r.dot(centre);
    return (b - std::sqrt(b * b - a * (centre.squaredNorm() - 0.01))) / a;  // NaN: misses
  };
  const RangeImage out = EstimateNormals(MakeCloud(sphere, 0.0, 1), {});
  int count = 0;
  for (std::size_t i = 0; i < out.points.size(); ++i) {
    if (!out.points[i].allFinite()) continue;
    const Eigen::Vector3d truth = (out.points[i].cast<double>() - centre).normalized();
    const double cosine = truth.dot(-centre.normalized());
    if (cosine < 0.6) continue;  // one-sided windows at the rim
    const double angle_deg =
        kDegPerRad * std::acos(std::min(1.0, truth.dot(out.normals[i].cast<double>())));
    ASSERT_LT(angle_deg, 1.0);
    ++count;
  }
  EXPECT_GT(count, 2000);
}

// A plane fit over a 5 x 5 window with pitch p has the slope error sigma / (p sqrt(50)) per axis.
TEST(EstimateNormals, NoiseReachesTheBoundOfThePlaneFit) {
  const double sigma_m = 0.0002;
  const RangeImage out =
      EstimateNormals(MakeCloud(test::PlaneDepth(Eigen::Vector3d::UnitZ(), 0.5), sigma_m, 3), {});
  double sum = 0.0;
  int count = 0;
  for (int y = 40; y < 60; ++y) {
    for (int x = 45; x < 75; ++x) {
      sum += out.normals(x, y).head<2>().cast<double>().squaredNorm();
      ++count;
    }
  }
  const double bound = sigma_m / (0.5 / 300.0 * std::sqrt(50.0)) * std::sqrt(2.0);
  EXPECT_NEAR(std::sqrt(sum / count) / bound, 1.0, 0.1);
}

TEST(EstimateNormals, DirectionalLineOfSight) {
  const Eigen::Vector3f normal = Eigen::Vector3f(0.4F, -0.2F, 1.0F).normalized();
  RangeImage range = MakeRangeImage(30, 20);
  range.line_of_sight.directional = true;
  range.line_of_sight.camera = Eigen::Vector3f::UnitZ();
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 30; ++x) {
      const float px = 0.001F * static_cast<float>(x);
      const float py = 0.001F * static_cast<float>(y);
      range.points(x, y) = {px, py, -(normal.x() * px + normal.y() * py) / normal.z()};
    }
  }
  const RangeImage out = EstimateNormals(range, {});
  EXPECT_EQ(CountValid(out), 600);
  for (const Eigen::Vector3f& n : out.normals) ASSERT_NEAR(n.dot(normal), 1.0F, 1e-5F);
}

TEST(EstimateNormals, DoesNotBridgeADepthStep) {
  const auto step = [](const Eigen::Vector2d& ray) { return ray.x() < 0.0 ? 0.5 : 0.55; };
  const RangeImage out = EstimateNormals(MakeCloud(step, 0.0, 1), {});
  EXPECT_GT(CountValid(out), 120 * 100 - 3 * 100);
  for (const Eigen::Vector3f& n : out.normals) {
    if (n.allFinite()) {
      ASSERT_NEAR(n.z(), -1.0F, 1e-5F);
    }
  }
}

TEST(EstimateNormals, DropsThinObliqueAndInvalidPoints) {
  RangeImage line = MakeRangeImage(20, 20);
  for (int x = 0; x < 20; ++x) {
    line.points(x, 10) = {0.001F * static_cast<float>(x), 0.0F, 0.5F};
    line.sigma_range(x, 10) = 1e-5F;
  }
  EXPECT_EQ(CountValid(EstimateNormals(line, {})), 0);

  TriangulationConfig config;
  config.max_normal_angle_deg = 50.0;
  const auto tilted = test::PlaneDepth(Eigen::Vector3d(2.0, 0.0, 1.0).normalized(), 0.3);
  EXPECT_EQ(CountValid(EstimateNormals(MakeCloud(tilted, 0.0, 1), config)), 0);
  EXPECT_EQ(CountValid(EstimateNormals(MakeRangeImage(5, 5), {})), 0);
  EXPECT_EQ(CountValid(EstimateNormals(MakeRangeImage(0, 0), {})), 0);
}

}  // namespace
}  // namespace fringe_fusion
