#include "fringe_fusion/pose/view_pose.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <limits>

#include "test/pose/lit_scene.hpp"

namespace fringe_fusion {
namespace {

using testing::FarProjector;
using testing::Lit;

const CameraModel kProjector = testing::LitProjector();

TEST(EstimateViewPose, StatesItsErrorTruly) {
  const Transform truth = FarProjector();
  double nees = 0.0;
  constexpr int kRuns = 40;
  for (int run = 0; run < kRuns; ++run) {
    const auto pose =
        EstimateViewPose(Lit(truth, 16, 100U + static_cast<unsigned>(run)), kProjector, {});
    ASSERT_TRUE(pose) << pose.error().message;
    const Vector6d error = Log(pose->T_projector_rig.inverse() * truth);
    nees += error.dot(pose->covariance.ldlt().solve(error)) / 6.0 / kRuns;
  }
  // 240 degrees of freedom: standard error 0.09.
  EXPECT_GT(nees, 0.73);
  EXPECT_LT(nees, 1.27);
}

TEST(MakeLitPoints, TakesThePointAtEachCameraPixel) {
  RangeImage range = MakeRangeImage(4, 3);
  range.points(2, 1) = {0.03F, 0.04F, 0.5F};
  range.normals(2, 1) = -Eigen::Vector3f::UnitZ();
  range.sigma_range(2, 1) = 3e-4F;
  range.sigma_lateral(2, 1) = 1e-4F;
  Match match;
  match.observed_px = {100.0, 50.0};
  std::vector<Match> matches;
  for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(2, 1), {0, 0}, {-1, 1}, {4, 2}}) {
    match.anchor_px = pixel;
    matches.push_back(match);
  }
  const std::vector<LitPoint> lit = MakeLitPoints(range, matches);
  ASSERT_EQ(lit.size(), 1U) << "no point at one pixel, two outside";
  EXPECT_EQ(lit[0].projector_px, match.observed_px);
  const Eigen::Vector3d ray = lit[0].point_rig.normalized();
  EXPECT_NEAR(std::sqrt(ray.dot(lit[0].covariance_m2 * ray)), 3e-4, 1e-9);
  const Eigen::Vector3d across = ray.cross(Eigen::Vector3d::UnitX()).normalized();
  EXPECT_NEAR(std::sqrt(across.dot(lit[0].covariance_m2 * across)), 1e-4, 1e-9);
}

// science 3.6: 2500 points, 0.1 px, 950 mm: rotation 0.0037 deg, translation 0.008 mm.
TEST(EstimateViewPose, SurvivesOutliers) {
  auto points = Lit(FarProjector(), 30, 7);
  for (std::size_t i = 0; i < points.size(); i += 5) points[i].projector_px.x() += 60.0;
  const auto pose = EstimateViewPose(points, kProjector, {});
  ASSERT_TRUE(pose) << pose.error().message;
  const Vector6d error = Log(pose->T_projector_rig.inverse() * FarProjector());
  EXPECT_LT(error.dot(pose->covariance.ldlt().solve(error)), 30.0);
  EXPECT_NEAR(static_cast<double>(pose->num_inliers) / pose->num_points, 0.8, 0.02);
}

TEST(EstimateViewPose, RefusalsNameTheCause) {
  auto points = Lit(FarProjector(), 16, 7);
  EXPECT_FALSE(EstimateViewPose({points.begin(), points.begin() + 10}, kProjector, {}));
  auto bad = points;
  bad[3].point_rig.z() = std::numeric_limits<double>::quiet_NaN();
  const auto nan = EstimateViewPose(bad, kProjector, {});
  ASSERT_FALSE(nan);
  EXPECT_NE(nan.error().message.find("point 3"), std::string::npos);
  std::mt19937 engine(2);
  for (LitPoint& point : points) {
    point.projector_px = {static_cast<double>(engine() % 1280),
                          static_cast<double>(engine() % 800)};
  }
  EXPECT_FALSE(EstimateViewPose(points, kProjector, {}));
}

}  // namespace
}  // namespace fringe_fusion
