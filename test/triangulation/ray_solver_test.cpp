#include "src/triangulation/ray_solver.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "analytic_view.hpp"

namespace fringe_fusion::triangulation {
namespace {

const Eigen::Vector2d kRay(0.11, -0.07);
constexpr double kDepth = 0.48;

Observation Observe(const CellCalibration& cell, double depth_m) {
  Observation out;
  out.pixel = Project(cell.projector, cell.T_projector_camera * (depth_m * kRay.homogeneous()));
  out.sigma = {0.1, 0.2};
  return out;
}

TEST(RaySolver, FindsTheDepthThroughDistortion) {
  const CellCalibration cell = test::MakeScanner();
  const RayPoint point = RaySolver(cell).Solve(kRay, Observe(cell, kDepth));
  ASSERT_TRUE(point.converged);
  EXPECT_NEAR(point.depth_m, kDepth, 1e-10);
  EXPECT_NEAR(point.epipolar_px, 0.0, 1e-7);
}

// The predicted sigma against the numerical derivative of the depth in both coordinates.
TEST(RaySolver, SigmaIsThePropagatedNoise) {
  const CellCalibration cell = test::MakeScanner();
  const RaySolver solver(cell);
  const Observation at = Observe(cell, kDepth);
  double variance = 0.0;
  for (int axis = 0; axis < 2; ++axis) {
    Observation moved = at;
    moved.pixel[axis] += 1e-3;
    const double derivative = (solver.Solve(kRay, moved).depth_m - kDepth) / 1e-3;
    variance += std::pow(derivative * at.sigma[axis], 2);
  }
  EXPECT_NEAR(solver.Solve(kRay, at).sigma_depth_m / std::sqrt(variance), 1.0, 1e-3);
}

TEST(RaySolver, DistanceToTheEpipolarLine) {
  const CellCalibration cell = test::MakeScanner();
  Observation moved = Observe(cell, kDepth);
  const Eigen::Vector2d along = (Observe(cell, kDepth + 1e-4).pixel - moved.pixel).normalized();
  moved.pixel += 1.5 * Eigen::Vector2d(-along.y(), along.x());
  const RayPoint point = RaySolver(cell).Solve(kRay, moved);
  ASSERT_TRUE(point.converged);
  EXPECT_NEAR(std::abs(point.epipolar_px), 1.5, 0.01);
}

TEST(RaySolver, RefusesWhatHasNoDepth) {
  const CellCalibration cell = test::MakeScanner();
  const RaySolver solver(cell);
  Observation nothing;
  nothing.pixel.setConstant(std::nan(""));
  EXPECT_FALSE(solver.Solve(kRay, nothing).converged);
  Observation no_sigma = Observe(cell, kDepth);
  no_sigma.sigma.setConstant(std::nan(""));
  EXPECT_FALSE(solver.Solve(kRay, no_sigma).converged);
  EXPECT_FALSE(solver.Solve({std::nan(""), 0.0}, Observe(cell, kDepth)).converged);
}

}  // namespace
}  // namespace fringe_fusion::triangulation
