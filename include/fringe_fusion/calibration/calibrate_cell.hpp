#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/calibration/target.hpp"
#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/geometry/transform.hpp"

namespace fringe_fusion {

/// Settings of the calibration of a cell. File: config/calibration.yaml.
struct CalibrationConfig {
  int min_poses = 3;                ///< that take part in the end
  int min_points = 8;               ///< per pose and device
  bool equal_weights = false;       ///< every point counts the same: when covariances are not known
  double huber_sigma = 3.0;         ///< residuals beyond count linearly
  double reject_sigma = 6.0;        ///< a point beyond is a bad detection
  double max_pose_ratio = 3.0;      ///< held-out rms of a pose over the rms of the others
  double max_rejected_ratio = 0.3;  ///< of the points of a pose: beyond, the pose goes
  int distortion_camera = -1;       ///< see DistortionLevel; -1: chosen by held-out error
  int distortion_projector = -1;    ///< likewise
  double min_tilt_deg = 5.0;        ///< largest angle between two poses of the target, at least
  double max_condition = 1e12;      ///< of the normal equations, scaled to unit diagonal
  double min_distance_m = 0.05;     ///< of the target: beyond, its size has the wrong unit
  double max_distance_m = 20.0;
  double sigma_stage_m = 5e-6;  ///< of a stage displacement, each axis
  // Limits of the verdict.
  double max_rms_px = 1.0;              ///< per device
  double max_focal_sigma_ratio = 5e-3;  ///< standard deviation of a focal length, relative
  double max_error_m = 5e-4;        ///< predicted error of a point, rms over the volume, any axis
  double min_coverage_ratio = 0.4;  ///< of either image
  double min_depth_ratio = 0.1;     ///< depth range of the points over their mean distance

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("min_poses", min_poses, 1, 10000);
    field("min_points", min_points, 6, 1000000);
    field("equal_weights", equal_weights);
    field("huber_sigma", huber_sigma, 1.0, 1000.0);
    field("reject_sigma", reject_sigma, 2.0, 1e6);
    field("max_pose_ratio", max_pose_ratio, 1.2, 1e6);
    field("max_rejected_ratio", max_rejected_ratio, 0.0, 1.0);
    field("distortion_camera", distortion_camera, -1, 4);
    field("distortion_projector", distortion_projector, -1, 4);
    field("min_tilt_deg", min_tilt_deg, 0.0, 90.0);
    field("max_condition", max_condition, 1.0, 1e18);
    field("min_distance_m", min_distance_m, 0.0, 1e3);
    field("max_distance_m", max_distance_m, 1e-3, 1e6);
    field("sigma_stage_m", sigma_stage_m, 1e-9, 1e-2);
    field("max_rms_px", max_rms_px, 1e-3, 1e3);
    field("max_focal_sigma_ratio", max_focal_sigma_ratio, 1e-6, 1.0);
    field("max_error_m", max_error_m, 1e-7, 1.0);
    field("min_coverage_ratio", min_coverage_ratio, 0.0, 1.0);
    field("min_depth_ratio", min_depth_ratio, 0.0, 10.0);
  }
};

/// Which distortion terms are free: 0 none, 1 k1, 2 k1 k2, 3 k1 k2 p1 p2, 4 all five.
enum class DistortionLevel { kNone, kK1, kK1K2, kTangential, kAll };

/// "k1 k2 p1 p2" and the like.
[[nodiscard]] std::string DistortionName(DistortionLevel level);

/// Pixels of the two devices.
struct DeviceSizes {
  int camera_width = 0;
  int camera_height = 0;
  int projector_width = 0;
  int projector_height = 0;
};

/// A sighting of a target that a stage has moved: sightings of one group share one pose, and their
/// targets are displaced by `shift_m` [target frame] to sigma_stage_m.
struct StageStation {
  int group = -1;  ///< -1: not on a stage
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();
};

/// Order of the parameters of a cell: fx fy cx cy k1 k2 p1 p2 k3 of the camera, the same of the
/// projector, then rotation and translation of the right perturbation of T_projector_camera.
constexpr int kNumCellParameters = 24;
using CellCovariance = Eigen::Matrix<double, kNumCellParameters, kNumCellParameters>;

/// Name of a parameter, e.g. "projector cy".
[[nodiscard]] std::string CellParameterName(int parameter);

/// The parameters; the pose as rotation vector and translation of T_projector_camera.
[[nodiscard]] std::array<double, kNumCellParameters> CellParameterValues(
    const CellCalibration& calibration);

/// What became of one sighting.
struct PoseOutcome {
  std::string name;
  bool used = false;
  std::string reason;  ///< why it was left out
  Transform T_camera_target = Transform::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< of its right perturbation
  double rms_camera_px = 0.0;              ///< distance, of the points that take part
  double rms_projector_px = 0.0;
  double held_out_ratio = 0.0;  ///< rms of the whitened residual when this pose took no part
  int num_points_camera = 0;
  int num_points_projector = 0;
};

/// A detection that takes no part although its pose does.
struct RejectedPoint {
  int sighting = 0;
  int point = 0;
  bool in_projector = false;
  double distance_px = 0.0;  ///< from its prediction
  double sigma = 0.0;        ///< the same in standard deviations
};

/// Residual of a point that takes part, measured minus predicted.
struct CellResidual {
  int sighting = 0;
  int point = 0;
  bool in_projector = false;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< measured
  Eigen::Vector2d residual_px = Eigen::Vector2d::Zero();
};

/// One distortion model that was tried.
struct ModelTrial {
  DistortionLevel camera = DistortionLevel::kNone;
  DistortionLevel projector = DistortionLevel::kNone;
  double rms_px = 0.0;           ///< joint, of the fit
  double held_out_rms_px = 0.0;  ///< joint, each pose predicted without itself
  double held_out_cost = 0.0;    ///< weighted, by which it is chosen
};

/// How the poses fill images, angles and depth.
struct Coverage {
  double camera_ratio = 0.0;     ///< cells of an 8 x 6 grid that hold a point
  double projector_ratio = 0.0;  ///< likewise
  double max_tilt_deg = 0.0;     ///< largest angle between two poses
  double depth_ratio = 0.0;      ///< depth range of all points over their mean distance
  std::string gaps;              ///< in words; empty: none
};

/// Where the target would help most.
struct NextPose {
  Transform T_camera_target = Transform::Identity();
  double error_before_m = 0.0;  ///< predicted, rms over the volume and the axes
  double error_after_m = 0.0;
  std::string words;
};

struct Verdict {
  bool accepted = false;
  std::vector<std::string> reasons;  ///< each limit that was passed, with value and limit
  std::string advice;                ///< what to improve first
  std::string words;                 ///< one paragraph
};

struct CellCalibrationResult {
  CellCalibration calibration;
  CellCovariance covariance = CellCovariance::Zero();  ///< zero rows: held parameters
  /// Of the 24 parameters and then of every pose that takes part, in order.
  Eigen::MatrixXd joint_covariance;
  std::vector<PoseOutcome> poses;               ///< one per sighting
  std::vector<RejectedPoint> rejected;          ///< bad detections
  std::vector<CellResidual> residuals;          ///< good ones
  std::vector<Eigen::Vector3d> target_points;   ///< with the shape found [m]
  std::vector<Eigen::Vector3d> stage_shifts_m;  ///< one per sighting, zero without a stage
  DistortionLevel distortion_camera = DistortionLevel::kNone;
  DistortionLevel distortion_projector = DistortionLevel::kNone;
  std::vector<ModelTrial> trials;
  // rms of the distances between measured and predicted pixels [px], OpenCV's figure.
  double rms_camera_px = 0.0;
  double rms_projector_px = 0.0;
  double rms_joint_px = 0.0;
  // Factor by which residuals exceed the stated covariances, at least 1; the covariance has it.
  double sigma_scale_camera = 1.0;
  double sigma_scale_projector = 1.0;
  double condition = 0.0;
  Coverage coverage;
  NextPose next;
  Verdict verdict;
};

/// Calibrates camera, projector and their pose from sightings of a flat target, all together.
///
/// Start: Zhang's closed form for each device, several values of the principal point (that of a
/// projector may lie outside its image), the lower optimum wins. Then one bundle adjustment over
/// both devices, T_projector_camera, all poses, the points of the target where sigma_print_m > 0
/// and the shifts of a stage: Levenberg-Marquardt with analytic derivatives, whitened by the stated
/// covariances, Huber weights; centres of imaged ellipses are predicted. Poses and detections that
/// do not fit are left out with the reason. The distortion model is the one with the least error on
/// poses that were held out.
/// @param stage empty, or one per sighting.
/// @return error when the input cannot be a calibration: too few or parallel poses, a target in the
/// wrong unit, mirrored or with swapped rows and columns, a singular system. A result that misses a
/// limit is returned with its verdict.
/// Ref: Zhang, "A flexible new technique for camera calibration", PAMI 22(11), 2000; science 1.
[[nodiscard]] Result<CellCalibrationResult> CalibrateCell(
    const CalibrationTarget& target, const std::vector<TargetSighting>& sightings,
    const DeviceSizes& sizes, const CalibrationConfig& config,
    const std::vector<StageStation>& stage = {});

}  // namespace fringe_fusion
