#include "fringe_fusion/calibration/turntable_axis.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "device_scene.hpp"
#include "fringe_fusion/io/config_yaml.hpp"

namespace fringe_fusion {
namespace {

using test_support::AnglesOfStops;
using test_support::AxisError;
using test_support::DeviceNoise;
using test_support::ErrorOfAxis;
using test_support::kRadPerDeg;
using test_support::ReadTargets;
using test_support::SceneCell;
using test_support::SceneTarget;
using test_support::TableScene;
using test_support::TableStops;
using test_support::TransformOf;

class TurntableTest : public ::testing::Test {
 protected:
  void Turn(int num, double arc_deg) {
    stops_ = TableStops(num, arc_deg);
    targets_ = scene_.TargetsAt(AnglesOfStops(stops_), 0.0, 0.0, 0.0, 1);
  }
  [[nodiscard]] Result<TurntableResult> Calibrate(const DeviceNoise& noise = {}) const {
    return CalibrateTurntable(stops_, ReadTargets(targets_, noise, 7), config_);
  }
  void ExpectRefused(const std::vector<std::string>& words) const {
    const auto result = Calibrate();
    ASSERT_FALSE(result);
    for (const std::string& word : words) {
      EXPECT_NE(result.error().message.find(word), std::string::npos)
          << result.error().message << " lacks " << word;
    }
  }

  TableScene scene_;
  TurntableConfig config_;
  std::vector<TurntableStop> stops_;
  std::vector<Transform> targets_;
};

TEST_F(TurntableTest, IsExactOnExactPoses) {
  for (const double arc_deg : {40.0, 360.0}) {
    for (const bool angles_known : {true, false}) {
      Turn(6, arc_deg);
      config_.angles_known = angles_known;
      const auto result = Calibrate();
      ASSERT_TRUE(result) << result.error().message;
      const AxisError error = ErrorOfAxis(scene_, *result);
      EXPECT_LT(error.direction_rad, 1e-8) << arc_deg;
      EXPECT_LT(error.distance_m, 1e-8) << arc_deg;
      EXPECT_NEAR(result->arc_deg, arc_deg < 360.0 ? arc_deg : 300.0, 1e-6);
      EXPECT_LT(result->rms_miss_m, 1e-8);
      EXPECT_NEAR(std::remainder(result->angles_rad[4] - result->angles_rad[1] -
                                     (stops_[4].angle_rad - stops_[1].angle_rad),
                                 2.0 * M_PI),
                  0.0, 1e-8);
      EXPECT_EQ(result->covariance_base(2, 2), 0.0);
      EXPECT_EQ(result->covariance_base(5, 5), 0.0);
    }
  }
}

TEST_F(TurntableTest, FindsAnAxisThroughTheTarget) {
  // Turns hardly move its middle: what they move along the axis must not count.
  scene_.T_table_target = TransformOf({180.0, 0.0, 0.0}, {-0.125, 0.1, 0.0});
  Turn(5, 80.0);
  for (unsigned seed = 1; seed < 11; ++seed) {
    std::vector<TargetPose> seen = ReadTargets(targets_, {2e-5, 2e-6}, seed);
    // A solver's rotations are orthogonal to rounding only.
    for (TargetPose& pose : seen) pose.T_camera_target.linear() *= 1.0 + 1e-13;
    const auto result = CalibrateTurntable(stops_, seen, config_);
    ASSERT_TRUE(result) << result.error().message;
    EXPECT_LT(result->sigma_point_m, 1e-5) << seed;
    EXPECT_LT(ErrorOfAxis(scene_, *result).distance_m, 5.0 * result->sigma_point_m) << seed;
  }
}

TEST_F(TurntableTest, TurnsTheOtherWayRound) {
  Turn(6, 360.0);
  for (TurntableStop& stop : stops_) stop.angle_rad = -stop.angle_rad;
  const auto result = Calibrate();
  ASSERT_TRUE(result) << result.error().message;
  // Angles grow right-handed about the direction.
  EXPECT_LT(result->direction_camera.dot(scene_.T_camera_base.linear().col(2)), -0.999999);
}

TEST_F(TurntableTest, CovarianceIsThatOfPointsOnARing) {
  // Poses whose rotation tells next to nothing are points on one ring.
  const double radius_m = 0.1;
  scene_.T_table_target = TransformOf({175.0, 0.0, 0.0}, {radius_m, 0.0, 0.0});
  Turn(36, 360.0);
  config_.sigma_angle_deg = 1e-6;
  config_.sigma_wobble_deg = 1e-6;
  config_.sigma_runout_mm = 1e-6;
  const double sigma_m = 5e-5;
  std::vector<TargetPose> poses;
  for (const Transform& T : targets_) {
    Matrix6d covariance = Matrix6d::Zero();
    covariance.diagonal() << 0.3, 0.3, 0.3, sigma_m * sigma_m, sigma_m * sigma_m, sigma_m * sigma_m;
    poses.push_back({T, covariance});
  }
  const auto result = CalibrateTurntable(stops_, poses, config_);
  ASSERT_TRUE(result) << result.error().message;
  // Science 4.3, with the angles known.
  const double expected_rad = std::sqrt(2.0) * sigma_m / (radius_m * std::sqrt(36.0));
  EXPECT_NEAR(result->sigma_direction_rad, expected_rad, 0.02 * expected_rad);
  // With known angles the whole circle slides, not only its radius is told: the middle of N points.
  const double expected_m = sigma_m / std::sqrt(36.0);
  EXPECT_NEAR(result->sigma_point_m, expected_m, 0.02 * expected_m);
}

TEST_F(TurntableTest, PointsOfTheTargetTellIt) {
  stops_ = TableStops(18, 360.0);
  targets_ =
      scene_.TargetsAt(AnglesOfStops(stops_), 0.001 * kRadPerDeg, 2e-6, 0.01 * kRadPerDeg, 5);
  const TargetView view{SceneTarget(), SceneCell()};
  const auto sightings = test_support::SightAll(SceneCell(), view.target, targets_, {});
  for (const bool angles_known : {true, false}) {
    config_.angles_known = angles_known;
    const auto result = CalibrateTurntable(stops_, sightings, view, config_);
    ASSERT_TRUE(result) << result.error().message;
    const AxisError error = ErrorOfAxis(scene_, *result);
    EXPECT_LT(error.direction_rad, 3.5 * result->sigma_direction_rad);
    EXPECT_LT(error.distance_m, 3.5 * result->sigma_point_m);
    EXPECT_LT(error.direction_rad, 0.01 * kRadPerDeg);
    EXPECT_LT(error.distance_m, 2e-5);
    EXPECT_TRUE(result->verdict.accepted) << result->verdict.words;
  }
}

TEST_F(TurntableTest, ViewsOfAPartTellIt) {
  Turn(8, 360.0);
  const Transform T_object_camera_0 = targets_.front().inverse();
  std::vector<Pose> views;
  for (const Transform& T : targets_) {
    Pose pose;
    pose.T_object_camera = T.inverse();
    pose.covariance = views.empty() ? Matrix6d::Zero() : PoseCovariance(1e-4, 1e-5);
    views.push_back(pose);
  }
  const auto poses = TargetPosesOfViews(views);
  EXPECT_TRUE((poses.front().T_camera_target * T_object_camera_0).isApprox(Transform::Identity()));
  EXPECT_EQ(poses.front().covariance.norm(), 0.0);
  const auto result = CalibrateTurntable(stops_, poses, config_);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_LT(ErrorOfAxis(scene_, *result).direction_rad, 1e-7);
}

TEST_F(TurntableTest, BadStopIsLeftOutWithItsReason) {
  Turn(10, 360.0);
  targets_[4] = targets_[4] * TransformOf({0.0, 0.5, 0.0}, {0.002, 0.0, 0.0});
  stops_[7].angle_rad += 0.02;
  const auto result = Calibrate({0.003 * kRadPerDeg, 5e-6});
  ASSERT_TRUE(result) << result.error().message;
  for (std::size_t k = 0; k < stops_.size(); ++k) {
    EXPECT_EQ(result->stops[k].used, k != 4 && k != 7) << k << ": " << result->stops[k].reason;
  }
  EXPECT_NE(result->stops[4].reason.find("times what the others leave"), std::string::npos);
  EXPECT_LT(ErrorOfAxis(scene_, *result).distance_m, 2e-5);
}

TEST_F(TurntableTest, RefusesTooFewStops) {
  Turn(2, 90.0);
  ExpectRefused({"2 of 2 poses are usable, 3 are needed"});
  Turn(4, 90.0);
  stops_.pop_back();
  ExpectRefused({"3 stops of the turntable for 4 targets"});
}

TEST_F(TurntableTest, RefusesASmallArc) {
  Turn(6, 20.0);
  ExpectRefused({"the stops span 20.00 deg, at least 30 deg are needed"});
  Turn(6, 1.0);
  ExpectRefused({"turns by less than 3 deg between all stops"});
}

TEST_F(TurntableTest, RefusesAMotionThatIsNoRotation) {
  stops_ = TableStops(6, 300.0);
  for (int k = 0; k < 6; ++k) {
    targets_.push_back(scene_.T_camera_base *
                       TransformOf({20.0 * k, 9.0 * k * k, 60.0 * k}, Eigen::Vector3d::Zero()) *
                       scene_.T_table_target);
  }
  ExpectRefused({"no rotation about one axis", "limit 2 deg"});
}

TEST_F(TurntableTest, RefusesAnglesThatContradict) {
  Turn(6, 90.0);
  for (TurntableStop& stop : stops_) stop.angle_rad /= kRadPerDeg;  // taken for radians
  ExpectRefused({"the stated angles contradict the target", "limit 2 deg"});
  Turn(6, 90.0);
  stops_[3].angle_rad = std::nan("");
  ExpectRefused({"stop 3", "must be finite"});
}

TEST(TurntableConfig, FileStatesTheDefaults) {
  const auto file = LoadConfigFile<TurntableConfig>(SOURCE_DIR "/config/turntable.yaml");
  ASSERT_TRUE(file) << file.error().message;
  const TurntableConfig defaults;
  EXPECT_EQ(file->min_arc_deg, defaults.min_arc_deg);
  EXPECT_EQ(file->sigma_runout_mm, defaults.sigma_runout_mm);
  EXPECT_EQ(file->max_sigma_point_m, defaults.max_sigma_point_m);
}

}  // namespace
}  // namespace fringe_fusion
