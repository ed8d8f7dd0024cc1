// Calibration of a cell against the scene that made the sightings.
#include "fringe_fusion/calibration/calibrate_cell.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "cell_scene.hpp"
#include "fringe_fusion/calibration/error_field.hpp"
#include "test/support/draws.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

/// A small target: 7 x 6 dots over the same area as SceneTarget.
CalibrationTarget SmallTarget() {
  CalibrationTarget target = SceneTarget();
  target.num_columns = 7;
  target.num_rows = 6;
  target.pitch_m = 0.04;
  return target;
}

CalibrationConfig FixedModel() {
  CalibrationConfig config;
  config.distortion_camera = 3;
  config.distortion_projector = 3;
  return config;
}

CellCalibrationResult Calibrated(const CalibrationTarget& target,
                                 const std::vector<TargetSighting>& sightings,
                                 const CellCalibration& cell, const CalibrationConfig& config,
                                 const std::vector<StageStation>& stage = {}) {
  auto result = CalibrateCell(target, sightings, SizesOf(cell), config, stage);
  if (!result) throw std::runtime_error(result.error().message);
  return std::move(*result);
}

/// Squared error of points of the volume that a scan with the found calibration makes, and what
/// was predicted for them [m^2].
struct PointErrors {
  double measured_m2 = 0.0;
  double predicted_m2 = 0.0;
};

PointErrors ErrorsOverVolume(const CellCalibrationResult& result, const CellCalibration& truth) {
  PointErrors errors;
  for (int i = 0; i < 27; ++i) {
    const Eigen::Vector3d point(0.12 * (i % 3 - 1), 0.12 * (i / 3 % 3 - 1),
                                0.7 + 0.04 * (i / 9 - 1));
    const auto found = TriangulatePixels(result.calibration, Project(truth.camera, point),
                                         Project(truth.projector, truth.T_projector_camera * point),
                                         MeasurementNoise{});
    const auto predicted =
        PredictPointError(result.calibration, result.covariance, point, MeasurementNoise{});
    if (!found || !predicted) throw std::runtime_error("a point of the volume is not seen");
    errors.measured_m2 += (*found - point).squaredNorm();
    errors.predicted_m2 += predicted->calibration.trace();
  }
  return errors;
}

TEST(CalibrateCell, FindsTheCellWithoutNoise) {
  const CellCalibration truth = SceneCell();
  const CalibrationTarget target = SmallTarget();
  SceneNoise noise;
  noise.off = true;
  const auto sightings = SightAll(truth, target, ScenePoses(target, 10, 1), noise);
  const auto result = Calibrated(target, sightings, truth, FixedModel());
  // What is left: orders beyond the second of the lens within a dot.
  EXPECT_LT(result.rms_camera_px, 5e-4);
  EXPECT_LT(result.rms_projector_px, 5e-4);
  EXPECT_NEAR(result.calibration.camera.fx, truth.camera.fx, 0.1);
  EXPECT_NEAR(result.calibration.projector.fy, truth.projector.fy, 0.1);
  EXPECT_NEAR(result.calibration.projector.cy, truth.projector.cy, 0.1);
  EXPECT_LT(std::sqrt(ErrorsOverVolume(result, truth).measured_m2 / 27.0), 2e-6);
  EXPECT_EQ(result.poses.size(), 10U);
  for (const PoseOutcome& pose : result.poses) EXPECT_TRUE(pose.used) << pose.reason;
  EXPECT_TRUE(result.rejected.empty());
  EXPECT_TRUE(result.verdict.accepted) << result.verdict.words;
}

/// Eight runs: the stated covariance is true of the parameters, and the field of errors that it
/// predicts of the points.
TEST(CalibrateCell, StatesItsErrorTruly) {
  const CellCalibration truth = SceneCell();
  const CalibrationTarget target = SmallTarget();
  const auto poses = ScenePoses(target, 10, 2);
  double squared = 0.0;
  int total_dof = 0;
  PointErrors points;
  const int num_runs = test_support::Draws(8, 1);
  for (int run = 0; run < num_runs; ++run) {
    SceneNoise noise;
    noise.seed = static_cast<unsigned>(100 + run);
    const auto result =
        Calibrated(target, SightAll(truth, target, poses, noise), truth, FixedModel());
    int dof = 0;
    squared += NormalizedError(result, truth, &dof) * dof;
    total_dof += dof;
    const PointErrors errors = ErrorsOverVolume(result, truth);
    points.measured_m2 += errors.measured_m2;
    points.predicted_m2 += errors.predicted_m2;
  }
  EXPECT_EQ(total_dof, num_runs * 22);
  if (test_support::Sanitized()) return;
  const double normalised = squared / total_dof;
  const double ratio = std::sqrt(points.measured_m2 / points.predicted_m2);
  fmt::print(
      "squared error over stated {:.3f}, points: error over predicted {:.3f}, rms {:.4f} mm\n",
      normalised, ratio, 1e3 * std::sqrt(points.measured_m2 / (27.0 * num_runs)));
  // 176 degrees of freedom: one standard deviation is 0.107; bench/cell_study runs a hundred.
  EXPECT_GT(normalised, 0.7);
  EXPECT_LT(normalised, 1.35);
  EXPECT_GT(ratio, 0.7);
  EXPECT_LT(ratio, 1.3);
}

TEST(CalibrateCell, ChoosesTheLensModelByHeldOutError) {
  CellCalibration truth = SceneCell();
  const CalibrationTarget target = SmallTarget();
  const auto poses = ScenePoses(target, 14, 3);
  const auto curved = Calibrated(target, SightAll(truth, target, poses, {}), truth, {});
  EXPECT_GE(curved.distortion_camera, DistortionLevel::kTangential);
  EXPECT_GT(curved.trials.size(), 5U);
  truth.camera.distortion = {-0.05, 0.0, 0.0, 0.0, 0.0};
  truth.projector.distortion = {};
  const auto flat = Calibrated(target, SightAll(truth, target, poses, {}), truth, {});
  EXPECT_GE(flat.distortion_camera, DistortionLevel::kK1);
  // A model that is right may lose to a richer one by chance, not by much.
  const auto trial = [&](DistortionLevel camera, DistortionLevel projector) {
    return std::find_if(flat.trials.begin(), flat.trials.end(), [&](const ModelTrial& t) {
      return t.camera == camera && t.projector == projector;
    });
  };
  const auto chosen = trial(flat.distortion_camera, flat.distortion_projector);
  ASSERT_NE(chosen, flat.trials.end());
  EXPECT_LE(chosen->held_out_cost, flat.trials.front().held_out_cost);
  EXPECT_LT(std::sqrt(ErrorsOverVolume(flat, truth).measured_m2 / 27.0), 6e-5);
}

TEST(CalibrateCell, FindsAPrincipalPointFarOutsideTheImage) {
  CellCalibration truth = SceneCell();
  truth.projector.cy = 1250.0;  // of 800 rows
  // Turned so that its middle pixel still looks at the volume.
  const Eigen::Vector3d middle =
      Undistort(truth.projector, Eigen::Vector2d(639.5, 399.5)).homogeneous();
  const Transform T_camera_projector = SceneCell().T_projector_camera.inverse();
  const Eigen::Vector3d towards =
      T_camera_projector.linear().transpose() *
      (Eigen::Vector3d(0.0, 0.0, 0.7) - T_camera_projector.translation());
  Transform turned = T_camera_projector;
  turned.linear() = T_camera_projector.linear() * RotationBetween(middle, towards);
  truth.T_projector_camera = turned.inverse();
  const CalibrationTarget target = SmallTarget();
  const auto sightings = SightAll(truth, target, ScenePoses(target, 10, 4), {});
  const auto result = Calibrated(target, sightings, truth, FixedModel());
  const double sigma = std::sqrt(result.covariance(12, 12));
  EXPECT_NEAR(result.calibration.projector.cy, 1250.0, 5.0 * sigma);
  EXPECT_LT(sigma, 5.0);
  EXPECT_LT(result.rms_projector_px, 0.05);
}

TEST(CalibrateCell, LeavesOutBadPointsAndOneBadPose) {
  const CellCalibration truth = SceneCell();
  const CalibrationTarget target = SmallTarget();
  auto sightings = SightAll(truth, target, ScenePoses(target, 12, 5), {});
  sightings[2].points[5].pixel_camera.x() += 4.0;
  sightings[7].points[20].pixel_projector.y() -= 3.0;
  // The target moved between the camera's picture and the fringes.
  for (PointSighting& seen : sightings[9].points) {
    seen.pixel_projector += Eigen::Vector2d(1.5 + 0.002 * seen.pixel_projector.y(), -1.0);
  }
  const auto result = Calibrated(target, sightings, truth, FixedModel());
  for (std::size_t i = 0; i < result.poses.size(); ++i) {
    EXPECT_EQ(result.poses[i].used, i != 9) << result.poses[i].reason;
  }
  EXPECT_NE(result.poses[9].reason.find("bad pose"), std::string::npos) << result.poses[9].reason;
  ASSERT_EQ(result.rejected.size(), 2U);
  EXPECT_EQ(result.rejected[0].sighting, 2);
  EXPECT_EQ(result.rejected[0].point, sightings[2].points[5].point);
  EXPECT_NEAR(result.rejected[0].distance_px, 4.0, 0.3);
  EXPECT_TRUE(result.rejected[1].in_projector);
  int dof = 0;
  EXPECT_LT(NormalizedError(result, truth, &dof), 2.5);
}

TEST(CalibrateCell, FindsTheShapeOfAnImperfectPlate) {
  const CellCalibration truth = SceneCell();
  CalibrationTarget target = SmallTarget();
  target.sigma_print_m = 5e-5;
  std::vector<Eigen::Vector3d> printed = TargetPoints(target);
  std::mt19937 random(6);
  std::normal_distribution<double> normal(0.0, target.sigma_print_m);
  for (Eigen::Vector3d& p : printed) {
    p += Eigen::Vector3d(normal(random), normal(random), normal(random));
  }
  std::vector<TargetSighting> sightings;
  const auto poses = ScenePoses(target, 12, 7);
  for (std::size_t k = 0; k < poses.size(); ++k) {
    SceneNoise noise;
    noise.seed = static_cast<unsigned>(700 + k);
    sightings.push_back(Sight(truth, target, printed, poses[k], noise, "pose"));
  }
  const auto result = Calibrated(target, sightings, truth, FixedModel());
  // Up to the motion and the size that the prior alone fixes: distances along the plate.
  double before = 0.0;
  double after = 0.0;
  const auto nominal = TargetPoints(target);
  for (std::size_t j = 1; j < printed.size(); ++j) {
    const double distance = (printed[j] - printed[j - 1]).norm();
    before += std::pow((nominal[j] - nominal[j - 1]).norm() - distance, 2);
    after += std::pow((result.target_points[j] - result.target_points[j - 1]).norm() - distance, 2);
  }
  EXPECT_LT(std::sqrt(after), 0.3 * std::sqrt(before));
  EXPECT_LT(result.rms_camera_px, 0.06);
  int dof = 0;
  EXPECT_LT(NormalizedError(result, truth, &dof), 2.5);
}

TEST(CalibrateCell, CalibratesFromAStageThatShiftsOneTarget) {
  const CellCalibration truth = SceneCell();
  const CalibrationTarget target = SmallTarget();
  const Transform T = ScenePose(target, Eigen::Vector3d(0.0, 0.0, 0.66), 0.06, 0.4, 0.1);
  std::vector<TargetSighting> sightings;
  std::vector<StageStation> stage;
  for (int k = 0; k < 9; ++k) {
    const Eigen::Vector3d shift(0.002 * (k % 3), 0.0, 0.01 * k);
    SceneNoise noise;
    noise.seed = static_cast<unsigned>(800 + k);
    sightings.push_back(Sight(truth, target, TargetPoints(target),
                              T * Transform(Eigen::Translation3d(shift)), noise, "station"));
    stage.push_back({0, shift});
  }
  const auto result = Calibrated(target, sightings, truth, FixedModel(), stage);
  EXPECT_LT(result.rms_camera_px, 0.06);
  int dof = 0;
  EXPECT_LT(NormalizedError(result, truth, &dof), 2.5);
  EXPECT_LT((result.stage_shifts_m[5] - stage[5].shift_m).norm(), 2e-5);
}

TEST(CalibrateCell, TheSuggestedPoseHelpsAsPredicted) {
  const CellCalibration truth = SceneCell();
  const CalibrationTarget target = SmallTarget();
  auto poses = ScenePoses(target, 5, 9, 12.0);
  const auto before = Calibrated(target, SightAll(truth, target, poses, {}), truth, FixedModel());
  EXPECT_NE(before.next.words.find("place the target"), std::string::npos) << before.next.words;
  EXPECT_LT(before.next.error_after_m, before.next.error_before_m);
  poses.push_back(before.next.T_camera_target);
  const auto after = Calibrated(target, SightAll(truth, target, poses, {}), truth, FixedModel());
  EXPECT_NEAR(after.next.error_before_m / before.next.error_after_m, 1.0, 0.35);
}

TEST(CalibrateCell, TheVerdictNamesEveryLimitThatWasMissed) {
  const CellCalibration truth = SceneCell();
  const CalibrationTarget target = SmallTarget();
  const auto sightings = SightAll(truth, target, ScenePoses(target, 6, 10), {});
  CalibrationConfig config = FixedModel();
  config.max_rms_px = 0.01;
  config.max_focal_sigma_ratio = 1e-6;
  const auto result = Calibrated(target, sightings, truth, config);
  EXPECT_FALSE(result.verdict.accepted);
  EXPECT_EQ(result.verdict.reasons.size(), 4U);
  EXPECT_NE(result.verdict.words.find("rejected"), std::string::npos);
  EXPECT_NE(result.verdict.words.find("rms of the projector"), std::string::npos);
  EXPECT_NE(result.verdict.words.find("To improve first"), std::string::npos);
}

TEST(CalibrateCell, JointCovarianceHoldsThePosesToo) {
  const CellCalibration truth = SceneCell();
  const CalibrationTarget target = SmallTarget();
  const auto poses = ScenePoses(target, 6, 11);
  const auto result = Calibrated(target, SightAll(truth, target, poses, {}), truth, FixedModel());
  ASSERT_EQ(result.joint_covariance.rows(), kNumCellParameters + 36);
  const Eigen::MatrixXd C = result.joint_covariance;
  EXPECT_LT((C - C.transpose()).norm(), 1e-9 * C.norm());
  double squared = 0.0;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    const Vector6d error = Log(poses[k].inverse() * result.poses[k].T_camera_target);
    squared += error.dot(result.poses[k].covariance.ldlt().solve(error)) / 36.0;
  }
  EXPECT_GT(squared, 0.3);
  EXPECT_LT(squared, 2.5);
}

}  // namespace
}  // namespace fringe_fusion
