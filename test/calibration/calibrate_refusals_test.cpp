// What CalibrateCell says to input that cannot be a calibration.
#include <gtest/gtest.h>

#include <limits>

#include "cell_scene.hpp"
#include "fringe_fusion/io/config_yaml.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

CalibrationTarget CoarseTarget() {
  CalibrationTarget target = SceneTarget();
  target.num_columns = 6;
  target.num_rows = 4;
  target.pitch_m = 0.05;
  return target;
}

class Refusals : public ::testing::Test {
 protected:
  Refusals() : sightings_(SightAll(cell_, target_, ScenePoses(target_, 6, 1), {})) {
    config_.distortion_camera = 2;
    config_.distortion_projector = 2;
  }

  [[nodiscard]] Result<CellCalibrationResult> Calibrate() const {
    return CalibrateCell(target_, sightings_, SizesOf(cell_), config_);
  }
  void ExpectRefused(const std::vector<std::string>& words) const {
    const auto result = Calibrate();
    ASSERT_FALSE(result);
    for (const std::string& word : words) {
      EXPECT_NE(result.error().message.find(word), std::string::npos)
          << result.error().message << " lacks " << word;
    }
  }

  CellCalibration cell_ = SceneCell();
  CalibrationTarget target_ = CoarseTarget();
  CalibrationConfig config_;
  std::vector<TargetSighting> sightings_;
};

TEST_F(Refusals, TooFewPoses) {
  sightings_.resize(2);
  ExpectRefused({"2 of 2 poses are usable, 3 are needed"});
  sightings_.clear();
  ExpectRefused({"0 of 0 poses are usable"});
}

TEST_F(Refusals, ProjectorNeverSeen) {
  for (TargetSighting& sighting : sightings_) {
    for (PointSighting& seen : sighting.points) seen.has_projector = false;
  }
  ExpectRefused({"the projector's code is missing in all"});
}

TEST_F(Refusals, ParallelPoses) {
  std::vector<Transform> poses;
  for (int k = 0; k < 6; ++k) {
    poses.push_back(ScenePose(target_, Eigen::Vector3d(0.02 * (k % 3), 0.0, 0.66 + 0.02 * k), 0.2,
                              0.5, 0.3 * k));
  }
  // One plane orientation for all: rolls about the target's own normal.
  sightings_ = SightAll(cell_, target_, poses, {});
  ExpectRefused({"parallel within", "at least 5 deg", "tilt the target"});
}

TEST_F(Refusals, TargetInAnotherUnit) {
  target_.pitch_m = 5.0;  // 50 mm in dm
  target_.dot_radius_m = 0.5;
  config_.max_distance_m = 20.0;
  ExpectRefused({"pitch of 5 m", "another unit"});
}

TEST_F(Refusals, SwappedRowsAndColumns) {
  std::swap(target_.num_columns, target_.num_rows);
  ExpectRefused({"fit 6 columns x 4 rows, not 4 x 6", "swapped"});
}

TEST_F(Refusals, MirroredImage) {
  for (TargetSighting& sighting : sightings_) {
    for (PointSighting& seen : sighting.points) {
      seen.pixel_camera.x() = cell_.camera.width - 1 - seen.pixel_camera.x();
    }
  }
  ExpectRefused({"6 of 6 sightings are mirrored"});
}

TEST_F(Refusals, NumbersThatAreNone) {
  const TargetSighting good = sightings_[1];
  sightings_[1].points[2].pixel_camera.x() = std::numeric_limits<double>::quiet_NaN();
  ExpectRefused({"pose 1: point 2: camera: the pixel is not finite"});
  sightings_[1] = good;
  sightings_[1].points[2].covariance_projector_px2(0, 0) = -1.0;
  ExpectRefused({"pose 1: point 2: projector: the covariance", "not positive definite"});
  sightings_[1] = good;
  sightings_[1].points[2].point = 24;
  ExpectRefused({"pose 1: point 24: the target has points 0 to 23"});
  sightings_[1] = good;
  sightings_[1].points[2].point = sightings_[1].points[3].point;
  ExpectRefused({"occurs twice"});
  sightings_[1] = good;
  config_.reject_sigma = std::numeric_limits<double>::quiet_NaN();
  ExpectRefused({"reject_sigma = nan"});
}

TEST_F(Refusals, StageListOfAnotherLength) {
  const auto result = CalibrateCell(target_, sightings_, SizesOf(cell_), config_, {StageStation{}});
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().message.find("1 stage displacements for 6 sightings"),
            std::string::npos);
}

/// A pose of another target among good ones is left out and named; the others calibrate.
TEST_F(Refusals, OneSightingOfAnotherTargetIsLeftOut) {
  CalibrationTarget other = target_;
  std::swap(other.num_columns, other.num_rows);
  sightings_.push_back(
      Sight(cell_, other, TargetPoints(other), ScenePoses(other, 1, 3)[0], {}, "other target"));
  const auto result = Calibrate();
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_FALSE(result->poses[6].used);
  EXPECT_NE(result->poses[6].reason.find("do not lie on the target"), std::string::npos)
      << result->poses[6].reason;
  EXPECT_TRUE(result->poses[0].used) << result->poses[0].reason;
}

TEST_F(Refusals, SystemThatDeterminesNothingStatesItsCondition) {
  config_.max_condition = 10.0;
  ExpectRefused({"do not determine the cell: condition number", "limit 10", "told apart"});
}

TEST(CalibrationConfig, FileStatesTheDefaults) {
  const auto file = LoadConfigFile<CalibrationConfig>(SOURCE_DIR "/config/calibration.yaml");
  ASSERT_TRUE(file) << file.error().message;
  std::vector<double> expected;
  std::vector<double> read;
  const auto collect = [](std::vector<double>& values) {
    return [&values](const char* /*name*/, const auto& value, auto... /*bounds*/) {
      values.push_back(static_cast<double>(value));
    };
  };
  CalibrationConfig{}.Visit(collect(expected));
  CalibrationConfig(*file).Visit(collect(read));
  EXPECT_EQ(read, expected);
}

}  // namespace
}  // namespace fringe_fusion
