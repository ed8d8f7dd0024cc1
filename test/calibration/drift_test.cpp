#include "fringe_fusion/calibration/drift.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "cell_scene.hpp"
#include "fringe_fusion/calibration/error_field.hpp"
#include "fringe_fusion/io/config_yaml.hpp"

namespace fringe_fusion {
namespace {

using test_support::SceneCell;
using test_support::SceneTarget;

/// A cell that was calibrated well, and one sighting of it later.
class Drift : public ::testing::Test {
 protected:
  Drift() {
    covariance_ = CellCovariance::Zero();
    const double focal = 0.2;
    covariance_.diagonal().head<4>().setConstant(focal * focal);
    covariance_.diagonal().segment<4>(9).setConstant(focal * focal);
    covariance_.diagonal().segment<3>(18).setConstant(1e-10);
    covariance_.diagonal().tail<3>().setConstant(1e-10);
  }
  [[nodiscard]] Result<DriftResult> Update(const CellCalibration& now, unsigned seed) const {
    test_support::SceneNoise noise;
    noise.seed = seed;
    const Transform T = test_support::ScenePose(target_, {0.01, -0.02, 0.7}, 0.4, 1.0, 0.2);
    return UpdateCell(before_, covariance_, target_,
                      test_support::Sight(now, target_, TargetPoints(target_), T, noise, "later"),
                      config_);
  }
  /// Largest error of points of the volume through the cell now [m].
  [[nodiscard]] static double ErrorM(const CellCalibration& found, const CellCalibration& now) {
    double largest = 0.0;
    for (int i = 0; i < 27; ++i) {
      const Eigen::Vector3d point(0.08 * (i % 3 - 1), 0.08 * (i / 3 % 3 - 1),
                                  0.7 + 0.03 * (i / 9 - 1));
      const auto seen = TriangulatePixels(found, Project(now.camera, point),
                                          Project(now.projector, now.T_projector_camera * point),
                                          MeasurementNoise{});
      largest = std::max(largest, seen ? (*seen - point).norm() : 1.0);
    }
    return largest;
  }

  CellCalibration before_ = SceneCell();
  CellCovariance covariance_;
  CalibrationTarget target_ = SceneTarget();
  DriftConfig config_;
};

TEST_F(Drift, FindsAProjectorThatTurned) {
  CellCalibration now = before_;
  Vector6d moved;
  moved << 5e-4, -7e-4, 2e-4, 0.0, 0.0, 0.0;
  now.T_projector_camera = before_.T_projector_camera * Exp(moved);
  const auto result = Update(now, 1);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(result->has_moved) << result->words;
  EXPECT_NE(result->words.find("the cell has moved"), std::string::npos);
  EXPECT_LT(result->rms_after_px, 0.2 * result->rms_before_px);
  EXPECT_LT(ErrorM(result->calibration, now), 0.2 * ErrorM(before_, now));
  // One view of a plane cannot tell all: what it does not tell stays as it was.
  EXPECT_GE(result->num_observed, 3);
  EXPECT_LT(result->num_observed, 14);
  EXPECT_EQ(result->observed.size(), static_cast<std::size_t>(result->num_observed));
  EXPECT_EQ(result->calibration.camera.distortion, before_.camera.distortion);
  EXPECT_LE(result->covariance(19, 19), covariance_(19, 19) + std::pow(0.05 * M_PI / 180.0, 2));
}

TEST_F(Drift, LeavesACellThatDidNotMove) {
  for (unsigned seed = 1; seed < 6; ++seed) {
    const auto result = Update(before_, seed);
    ASSERT_TRUE(result) << result.error().message;
    EXPECT_FALSE(result->has_moved) << result->words;
    EXPECT_LT(ErrorM(result->calibration, before_), 1e-4);
  }
}

TEST_F(Drift, RefusesWhatOneViewCannotCorrect) {
  CellCalibration now = before_;
  now.T_projector_camera = before_.T_projector_camera * Exp(Vector6d::Constant(0.02));
  const auto far = Update(now, 1);
  ASSERT_FALSE(far);
  EXPECT_NE(far.error().message.find("limit"), std::string::npos) << far.error().message;
  config_.min_points = 500;
  const auto few = Update(before_, 1);
  ASSERT_FALSE(few);
  EXPECT_NE(few.error().message.find("99 points are seen by both devices, 500 are needed"),
            std::string::npos)
      << few.error().message;
  config_.min_points = 1;
  EXPECT_NE(Update(before_, 1).error().message.find("min_points = 1"), std::string::npos);
}

TEST(DriftConfig, FileStatesTheDefaults) {
  const auto file = LoadConfigFile<DriftConfig>(SOURCE_DIR "/config/drift.yaml");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->sigma_focal_ratio, DriftConfig{}.sigma_focal_ratio);
  EXPECT_EQ(file->max_moved_sigma, DriftConfig{}.max_moved_sigma);
}

}  // namespace
}  // namespace fringe_fusion
