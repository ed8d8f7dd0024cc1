#include "fringe_fusion/calibration/hand_eye.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "device_scene.hpp"
#include "fringe_fusion/io/config_yaml.hpp"
#include "src/calibration/hand_eye_start.hpp"
#include "src/common/dense.hpp"
#include "test/support/draws.hpp"

namespace fringe_fusion {
namespace {

using test_support::DeviceNoise;
using test_support::HandEyeViews;
using test_support::kRadPerDeg;
using test_support::PerturbationTo;
using test_support::ReadRobot;
using test_support::ReadTargets;
using test_support::RobotScene;
using test_support::SceneCell;
using test_support::SceneTarget;
using test_support::TransformOf;

const DeviceNoise kRobotNoise{0.005 * kRadPerDeg, 2e-5};
const DeviceNoise kTargetNoise{0.004 * kRadPerDeg, 1e-5};

/// A robot of the usual accuracy, eye in hand unless told otherwise.
class HandEye : public ::testing::Test {
 protected:
  [[nodiscard]] Result<HandEyeResult> Calibrate() const {
    return CalibrateHandEye(robot_, targets_, scene_.mount, config_);
  }
  void Read(int num, const DeviceNoise& robot_noise, const DeviceNoise& target_noise,
            unsigned seed) {
    views_ = HandEyeViews(SceneTarget(), num, seed);
    robot_ = ReadRobot(scene_, views_, robot_noise, seed + 1000U);
    targets_ = ReadTargets(views_, target_noise, seed + 2000U);
  }
  void ExpectRefused(const std::vector<std::string>& words) const {
    const auto result = Calibrate();
    ASSERT_FALSE(result);
    for (const std::string& word : words) {
      EXPECT_NE(result.error().message.find(word), std::string::npos)
          << result.error().message << " lacks " << word;
    }
  }

  RobotScene scene_;
  HandEyeConfig config_;
  std::vector<Transform> views_;
  std::vector<DevicePose> robot_;
  std::vector<TargetPose> targets_;
};

TEST_F(HandEye, ClosedFormsAreExactOnExactMotions) {
  Read(5, {}, {}, 3);
  std::vector<Transform> carriers;
  for (const DevicePose& pose : robot_) carriers.push_back(pose.T_base_flange.inverse());
  const auto motions = chain::MotionPairs(views_, carriers);
  EXPECT_EQ(motions.size(), 10U);
  for (const auto& found : {chain::ParkMartin(motions), chain::DualQuaternion(motions)}) {
    ASSERT_TRUE(found);
    const Vector6d error = PerturbationTo(scene_.T_carrier_camera, found->inverse());
    EXPECT_LT(error.norm(), 1e-9);
  }
  EXPECT_FALSE(chain::ParkMartin({}));
  EXPECT_FALSE(chain::DualQuaternion({}));
}

TEST_F(HandEye, IsExactOnExactPosesOfBothMounts) {
  for (const HandEyeMount mount : {HandEyeMount::kEyeInHand, HandEyeMount::kEyeToHand}) {
    scene_.mount = mount;
    Read(6, {}, {}, 5);
    const auto result = Calibrate();
    ASSERT_TRUE(result) << result.error().message;
    EXPECT_LT(PerturbationTo(scene_.T_carrier_camera, result->T_carrier_camera).norm(), 1e-8);
    EXPECT_LT(PerturbationTo(scene_.T_other_target, result->T_other_target).norm(), 1e-8);
    EXPECT_LT(result->target_spread_m, 1e-8);
    EXPECT_TRUE(result->verdict.accepted) << result->verdict.words;
    EXPECT_EQ(result->poses.size(), 6U);
    EXPECT_EQ(result->sigma_scale_rotation, 1.0);
    EXPECT_GT(result->max_rotation_deg, 60.0);
  }
}

TEST_F(HandEye, ErrorIsThatOfItsCovariance) {
  double squared = 0.0;
  double dof = 0.0;
  for (unsigned run = 0; run < static_cast<unsigned>(test_support::Draws(50, 2)); ++run) {
    scene_.mount = run % 2 == 0 ? HandEyeMount::kEyeInHand : HandEyeMount::kEyeToHand;
    Read(12, kRobotNoise, kTargetNoise, 10 + run);
    const auto result = Calibrate();
    ASSERT_TRUE(result) << result.error().message;
    for (const auto& [found, truth, covariance] :
         {std::tuple(result->T_carrier_camera, scene_.T_carrier_camera, result->covariance_camera),
          std::tuple(result->T_other_target, scene_.T_other_target, result->covariance_target)}) {
      const Vector6d error = PerturbationTo(truth, found);
      squared += error.dot(Vector6d(dense::SolveSymmetric(covariance, error)));
      dof += 6.0;
    }
  }
  if (test_support::Sanitized()) return;
  // Both ends are correlated: the deviation of the mean is at most that of 300 numbers, 0.08.
  EXPECT_NEAR(squared / dof, 1.0, 0.25);
}

TEST_F(HandEye, PointsOfTheTargetTellIt) {
  for (const bool with_projector : {true, false}) {
    Read(12, kRobotNoise, {}, 21);
    TargetView view{SceneTarget(), SceneCell()};
    if (!with_projector) view.devices.projector = CameraModel{};
    auto sightings = test_support::SightAll(SceneCell(), view.target, views_, {});
    // Two bad detections, far off.
    sightings[3].points[40].pixel_camera.x() += 4.0;
    sightings[5].points[10].pixel_camera.y() -= 3.0;
    const auto result = CalibrateHandEye(robot_, sightings, view, scene_.mount, config_);
    ASSERT_TRUE(result) << result.error().message;
    const Vector6d error = PerturbationTo(scene_.T_carrier_camera, result->T_carrier_camera);
    const double squared =
        error.dot(Vector6d(dense::SolveSymmetric(result->covariance_camera, error)));
    EXPECT_LT(squared, 22.5) << "beyond 99.9 %";
    EXPECT_GT(squared, 0.3) << "beyond 0.1 %";
    const Eigen::Vector3d point(0.0, 0.0, 0.62);
    EXPECT_LT((result->T_carrier_camera * point - scene_.T_carrier_camera * point).norm(), 5e-5);
    EXPECT_EQ(result->poses[3].num_rejected_points, 1);
    EXPECT_LT(result->rms_px, 0.06);
    EXPECT_TRUE(result->verdict.accepted) << result->verdict.words;
  }
}

TEST_F(HandEye, BadPosesAreLeftOutWithTheirReason) {
  Read(14, kRobotNoise, kTargetNoise, 31);
  robot_[2].T_base_flange =
      robot_[2].T_base_flange * TransformOf({0.0, 1.0, 0.0}, Eigen::Vector3d::Zero());
  robot_[7].T_base_flange =
      robot_[7].T_base_flange * TransformOf(Eigen::Vector3d::Zero(), {0.004, 0.0, 0.0});
  std::swap(robot_[10].T_base_flange, robot_[11].T_base_flange);
  const auto result = Calibrate();
  ASSERT_TRUE(result) << result.error().message;
  for (std::size_t k = 0; k < robot_.size(); ++k) {
    const bool is_bad = k == 2 || k == 7 || k == 10 || k == 11;
    EXPECT_EQ(result->poses[k].used, !is_bad) << k << ": " << result->poses[k].reason;
    EXPECT_EQ(result->poses[k].reason.empty(), !is_bad);
  }
  EXPECT_NE(result->poses[7].reason.find("times what the others leave (limit 3)"),
            std::string::npos)
      << result->poses[7].reason;
  EXPECT_NEAR(result->poses[2].rotation_miss_rad, kRadPerDeg, 0.1 * kRadPerDeg);
  const Vector6d error = PerturbationTo(scene_.T_carrier_camera, result->T_carrier_camera);
  EXPECT_LT(error.tail<3>().norm(), 1e-4);
}

TEST_F(HandEye, WorseRobotThanStatedIsFoundAndJudged) {
  Read(20, {0.1 * kRadPerDeg, 4e-4}, kTargetNoise, 41);
  for (DevicePose& pose : robot_) pose.covariance = PoseCovariance(0.01 * kRadPerDeg, 4e-5);
  const auto result = Calibrate();
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_NEAR(result->sigma_scale_rotation, 10.0, 3.0);
  EXPECT_NEAR(result->sigma_scale_translation, 10.0, 3.0);
  EXPECT_FALSE(result->verdict.accepted);
  EXPECT_NE(result->verdict.words.find("against its stated sigma"), std::string::npos)
      << result->verdict.words;
  const Vector6d error = PerturbationTo(scene_.T_carrier_camera, result->T_carrier_camera);
  EXPECT_LT(error.dot(Vector6d(dense::SolveSymmetric(result->covariance_camera, error))), 22.5);
}

TEST_F(HandEye, RefusesTooFewPoses) {
  Read(3, kRobotNoise, kTargetNoise, 51);
  ExpectRefused({"3 of 3 poses are usable, 4 are needed"});
  robot_.resize(2);
  ExpectRefused({"2 robot poses for 3 targets"});
}

TEST_F(HandEye, RefusesSmallRotations) {
  const Transform first = HandEyeViews(SceneTarget(), 1, 1).front();
  for (int k = 0; k < 8; ++k) {
    views_.push_back(first * TransformOf({1.0 * k, 1.5 * (k % 3), 0.0}, {0.01 * k, 0.0, 0.0}));
  }
  robot_ = ReadRobot(scene_, views_, kRobotNoise, 1);
  targets_ = ReadTargets(views_, kTargetNoise, 2);
  ExpectRefused({"turns by at most 7.", "at least 15 deg"});
}

TEST_F(HandEye, RefusesParallelAxes) {
  const Transform first = HandEyeViews(SceneTarget(), 1, 1).front();
  for (int k = 0; k < 8; ++k) {
    views_.push_back(first * TransformOf({0.0, 0.0, 12.0 * k}, {0.01 * k, 0.0, 0.02 * (k % 2)}));
  }
  robot_ = ReadRobot(scene_, views_, kRobotNoise, 1);
  targets_ = ReadTargets(views_, kTargetNoise, 2);
  ExpectRefused({"nearly parallel axes", "at most 0.0", "at least 5 deg", "second axis"});
}

TEST_F(HandEye, RefusesPosesThatAgreeOnNothing) {
  Read(6, kRobotNoise, kTargetNoise, 61);
  for (std::size_t k = 0; k < robot_.size(); ++k) {
    const double turn = 20.0 + 17.0 * static_cast<double>(k * k % 5);
    robot_[k].T_base_flange =
        robot_[k].T_base_flange * TransformOf({turn, -0.5 * turn, 3.0 * turn}, {0.1, 0.2, 0.0});
  }
  const auto result = Calibrate();
  if (result) {
    EXPECT_FALSE(result->verdict.accepted) << result->verdict.words;
  } else {
    EXPECT_NE(result.error().message.find("are needed"), std::string::npos)
        << result.error().message;
  }
}

TEST_F(HandEye, RefusesNumbersThatAreNone) {
  Read(6, kRobotNoise, kTargetNoise, 71);
  const auto good = robot_;
  robot_[1].T_base_flange.translation().x() = std::numeric_limits<double>::quiet_NaN();
  ExpectRefused({"pose 1", "robot pose", "not finite"});
  robot_ = good;
  robot_[4].covariance(2, 2) = -1.0;
  ExpectRefused({"pose 4", "covariance of the robot pose is not positive definite"});
  robot_ = good;
  targets_[3].T_camera_target.translation().z() = std::numeric_limits<double>::infinity();
  ExpectRefused({"pose 3", "target pose", "not finite"});
  targets_ = ReadTargets(views_, kTargetNoise, 2);
  targets_[2].covariance(0, 0) = -1.0;
  ExpectRefused({"pose 2", "covariance of the target pose is not positive definite"});
  config_.min_poses = 1;
  ExpectRefused({"min_poses = 1", "[3, 10000]"});
}

TEST_F(HandEye, RefusesTargetsThatLookTheSameTurnedRound) {
  Read(6, kRobotNoise, {}, 81);
  const TargetView view{SceneTarget(), SceneCell()};
  auto sightings = test_support::SightAll(SceneCell(), view.target, views_, {});
  sightings[2].is_orientation_assumed = true;
  const auto result = CalibrateHandEye(robot_, sightings, view, scene_.mount, config_);
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().message.find("pose 2: the target looks the same turned round"),
            std::string::npos)
      << result.error().message;
}

TEST(HandEyeMountName, NamesAreThoseOfTheFiles) {
  EXPECT_EQ(*HandEyeMountFromName("eye_to_hand"), HandEyeMount::kEyeToHand);
  EXPECT_STREQ(HandEyeMountName(HandEyeMount::kEyeInHand), "eye_in_hand");
  EXPECT_NE(HandEyeMountFromName("hand").error().message.find("eye_in_hand or eye_to_hand"),
            std::string::npos);
}

TEST(HandEyeConfig, FileStatesTheDefaults) {
  const auto file = LoadConfigFile<HandEyeConfig>(SOURCE_DIR "/config/hand_eye.yaml");
  ASSERT_TRUE(file) << file.error().message;
  const HandEyeConfig defaults;
  EXPECT_EQ(file->min_rotation_deg, defaults.min_rotation_deg);
  EXPECT_EQ(file->sigma_translation_mm, defaults.sigma_translation_mm);
  EXPECT_EQ(file->max_error_m, defaults.max_error_m);
  EXPECT_EQ(file->max_sigma_scale, defaults.max_sigma_scale);
}

}  // namespace
}  // namespace fringe_fusion
