#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/hand_eye.hpp"
#include "fringe_fusion/pose/view.hpp"

namespace fringe_fusion {

/// Settings of the calibration of a turntable. File: config/turntable.yaml.
struct TurntableConfig {
  int min_poses = 3;                ///< that take part in the end
  double min_arc_deg = 30.0;        ///< that the stops span, at least
  bool angles_known = true;         ///< false: the angles are found, and only their order counts
  double sigma_angle_deg = 0.01;    ///< of a stop about the axis, where angles are known
  double sigma_wobble_deg = 0.001;  ///< of the axis from stop to stop, each direction
  double sigma_runout_mm = 0.002;   ///< of the table from stop to stop, each axis
  double huber_sigma = 3.0;         ///< points beyond count linearly
  double reject_sigma = 6.0;        ///< a point beyond is a bad detection
  double max_pose_ratio = 3.0;      ///< what a stop misses when held out over what others miss
  double max_angle_miss_deg = 2.0;  ///< a turn that differs by more from the stated one is wrong
  double max_tilt_deg = 2.0;        ///< axis of one turn from that of all: no rotation beyond
  double max_condition = 1e12;      ///< of the normal equations, scaled to unit diagonal
  // Limits of the verdict.
  double max_sigma_direction_deg = 0.05;
  double max_sigma_point_m = 3e-4;
  double max_sigma_scale = 5.0;     ///< residuals over the stated standard deviations
  double max_rejected_ratio = 0.3;  ///< of the stops

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("min_poses", min_poses, 3, 10000);
    field("min_arc_deg", min_arc_deg, 1.0, 360.0);
    field("angles_known", angles_known);
    field("sigma_angle_deg", sigma_angle_deg, 1e-6, 10.0);
    field("sigma_wobble_deg", sigma_wobble_deg, 1e-6, 10.0);
    field("sigma_runout_mm", sigma_runout_mm, 1e-6, 1000.0);
    field("huber_sigma", huber_sigma, 1.0, 1000.0);
    field("reject_sigma", reject_sigma, 2.0, 1e6);
    field("max_pose_ratio", max_pose_ratio, 1.2, 1e6);
    field("max_angle_miss_deg", max_angle_miss_deg, 1e-3, 180.0);
    field("max_tilt_deg", max_tilt_deg, 1e-3, 90.0);
    field("max_condition", max_condition, 1.0, 1e18);
    field("max_sigma_direction_deg", max_sigma_direction_deg, 1e-5, 90.0);
    field("max_sigma_point_m", max_sigma_point_m, 1e-7, 1.0);
    field("max_sigma_scale", max_sigma_scale, 1.0, 1e6);
    field("max_rejected_ratio", max_rejected_ratio, 0.0, 1.0);
  }
};

/// One stop of a turntable.
struct TurntableStop {
  std::string name;
  double angle_rad = 0.0;        ///< ignored where angles are not known
  double sigma_angle_rad = 0.0;  ///< 0: of the settings
};

/// Axis of a turntable before a camera at rest: T_camera_target = T_camera_base RotZ(angle)
/// T_table_target. `turntable_base` has z along the axis, such that angles grow right-handed about
/// it; its origin is the point of the axis nearest to the middle of what was seen.
struct TurntableResult {
  Eigen::Vector3d point_camera = Eigen::Vector3d::Zero();       ///< on the axis [m]
  Eigen::Vector3d direction_camera = Eigen::Vector3d::UnitZ();  ///< unit
  Transform T_camera_base = Transform::Identity();
  /// Of its right perturbation; rotation about z and translation along z are conventions: zero.
  Matrix6d covariance_base = Matrix6d::Zero();
  Transform T_table_target = Transform::Identity();
  double sigma_direction_rad = 0.0;      ///< rms of both components
  double sigma_point_m = 0.0;            ///< rms of both components, at point_camera
  std::vector<DevicePoseOutcome> stops;  ///< corrections: of the table
  std::vector<double> angles_rad;        ///< found, one per stop
  double arc_deg = 0.0;
  double condition = 0.0;
  // Factors by which residuals exceed the stated sigmas, at least 1; the covariance has them.
  double sigma_scale_table = 1.0;
  double sigma_scale_target = 1.0;
  double rms_px = 0.0;      ///< of all points; 0 with target poses
  double rms_miss_m = 0.0;  ///< of the middle of the target from its circle
  Verdict verdict;
};

/// Axis from target poses at several angles. Angles with their sigmas, or free.
/// @param stops, target_poses of the same length, in the same order.
/// @return error with value and limit: too few stops, too small an arc, a motion that is not a
/// rotation about one axis, angles that contradict the poses.
/// Ref: science 4.3.
[[nodiscard]] Result<TurntableResult> CalibrateTurntable(
    const std::vector<TurntableStop>& stops, const std::vector<TargetPose>& target_poses,
    const TurntableConfig& config);

/// The same, refined on the points of the target in the camera and, where seen, the projector.
[[nodiscard]] Result<TurntableResult> CalibrateTurntable(
    const std::vector<TurntableStop>& stops, const std::vector<TargetSighting>& sightings,
    const TargetView& view, const TurntableConfig& config);

/// Registered views of an object on the table as target poses: the object is the target. The view
/// that was held in the registration (zero covariance) is exact.
[[nodiscard]] std::vector<TargetPose> TargetPosesOfViews(const std::vector<Pose>& views);

}  // namespace fringe_fusion
