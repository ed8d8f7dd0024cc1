#pragma once

#include <array>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/calibrate_cell.hpp"
#include "fringe_fusion/common/config.hpp"

namespace fringe_fusion {

/// Settings of the calibration of a hand-eye. File: config/hand_eye.yaml.
struct HandEyeConfig {
  int min_poses = 4;                    ///< that take part in the end
  double min_rotation_deg = 15.0;       ///< largest rotation between two poses, at least
  double min_cross_rotation_deg = 5.0;  ///< the same about any axis across the main one
  // Robot poses that state no covariance: each axis, of the flange in its own frame.
  double sigma_rotation_deg = 0.02;
  double sigma_translation_mm = 0.1;
  /// Lens terms of the camera found along, from points only: 0 none, 1 focal lengths and principal
  /// point, 2 also k1, 3 also k2. For a camera whose lens is known badly.
  int refine_lens = 0;
  double huber_sigma = 3.0;     ///< points beyond count linearly
  double reject_sigma = 6.0;    ///< a point beyond is a bad detection
  double max_pose_ratio = 3.0;  ///< what a pose misses when held out over what the others miss
  double max_condition = 1e12;  ///< of the normal equations, scaled to unit diagonal
  // Limits of the verdict.
  double max_error_m = 5e-4;        ///< predicted error of a point at the target, rms of the axes
  double max_sigma_scale = 5.0;     ///< residuals over the stated standard deviations
  double max_rejected_ratio = 0.3;  ///< of the poses

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("min_poses", min_poses, 3, 10000);
    field("min_rotation_deg", min_rotation_deg, 0.1, 180.0);
    field("min_cross_rotation_deg", min_cross_rotation_deg, 0.01, 180.0);
    field("sigma_rotation_deg", sigma_rotation_deg, 1e-6, 10.0);
    field("sigma_translation_mm", sigma_translation_mm, 1e-6, 1000.0);
    field("refine_lens", refine_lens, 0, 3);
    field("huber_sigma", huber_sigma, 1.0, 1000.0);
    field("reject_sigma", reject_sigma, 2.0, 1e6);
    field("max_pose_ratio", max_pose_ratio, 1.2, 1e6);
    field("max_condition", max_condition, 1.0, 1e18);
    field("max_error_m", max_error_m, 1e-7, 1.0);
    field("max_sigma_scale", max_sigma_scale, 1.0, 1e6);
    field("max_rejected_ratio", max_rejected_ratio, 0.0, 1.0);
  }
};

/// Who carries the camera.
enum class HandEyeMount {
  kEyeInHand,  ///< the flange; the target is at rest in the base
  kEyeToHand,  ///< the base, at rest; the target is on the flange
};
/// "eye_in_hand", "eye_to_hand".
[[nodiscard]] const char* HandEyeMountName(HandEyeMount mount);
/// @return error naming the words that there are.
[[nodiscard]] Result<HandEyeMount> HandEyeMountFromName(const std::string& name);

/// Where a device (robot, turntable) says that its flange was.
struct DevicePose {
  std::string name;
  Transform T_base_flange = Transform::Identity();
  /// Of its right perturbation; zero: sigmas of the settings.
  Matrix6d covariance = Matrix6d::Zero();
};

/// Where a camera found a target, as PoseOutcome states it.
struct TargetPose {
  Transform T_camera_target = Transform::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< of its right perturbation; zero: taken as exact
};

/// What became of one pose of a device.
struct DevicePoseOutcome {
  std::string name;
  bool used = false;
  std::string reason;                                 ///< why it was left out
  Transform T_camera_target = Transform::Identity();  ///< measured alone, without the device
  Matrix6d covariance = Matrix6d::Zero();             ///< of its right perturbation
  /// Where the device was, less where it says that it was: T_base_flange Exp(correction).
  Vector6d correction = Vector6d::Zero();
  double rotation_miss_rad = 0.0;   ///< measured target pose against that of the result
  double translation_miss_m = 0.0;  ///< likewise, of the middle of the target
  double held_out_ratio = 0.0;      ///< the miss over its sigma when this pose took no part
  double rms_px = 0.0;              ///< of the points that take part; 0 with target poses
  int num_points = 0;               ///< likewise
  int num_rejected_points = 0;      ///< bad detections
};

/// The carrier of the camera is the flange for an eye in hand and the base for an eye to hand; the
/// target is in the other one.
struct HandEyeResult {
  HandEyeMount mount = HandEyeMount::kEyeInHand;
  Transform T_carrier_camera = Transform::Identity();
  Transform T_other_target = Transform::Identity();
  Matrix6d covariance_camera = Matrix6d::Zero();  ///< of its right perturbation
  Matrix6d covariance_target = Matrix6d::Zero();  ///< of its right perturbation
  std::vector<DevicePoseOutcome> poses;           ///< one per pose given
  // Closed forms that the refinement started from, for comparison; the better one won.
  Transform T_carrier_camera_park_martin = Transform::Identity();
  Transform T_carrier_camera_dual_quaternion = Transform::Identity();
  // What of the robot's motion tells the result.
  double max_rotation_deg = 0.0;
  double max_cross_rotation_deg = 0.0;
  double condition = 0.0;
  // Factors by which residuals exceed the stated sigmas, at least 1; the covariances have them.
  double sigma_scale_rotation = 1.0;     ///< of the robot
  double sigma_scale_translation = 1.0;  ///< of the robot
  double sigma_scale_target = 1.0;       ///< of the points, or of the target poses
  double rms_px = 0.0;                   ///< of all points; 0 with target poses
  /// rms distance of the middle of the target, as every pose alone puts it into the frame where it
  /// rests, from where the result has it; what calibrations without robot noise call their spread.
  double target_spread_m = 0.0;
  /// The lens, with what was found of it, and its sigmas (fx fy cx cy k1 k2 p1 p2 k3; 0: taken as
  /// stated). Empty with target poses.
  CameraModel camera;
  std::array<double, 9> sigma_camera{};
  double predicted_error_m = 0.0;  ///< of a point at the target by the hand-eye, rms of the axes
  Verdict verdict;
};

/// Hand-eye from robot poses and target poses.
///
/// T_base_flange T_flange_camera T_camera_target = T_base_target (eye in hand) or
/// T_flange_base T_base_camera T_camera_target = T_flange_target (eye to hand). Starts: Park-Martin
/// and dual quaternions. Then one adjustment of both unknowns and of every robot pose, which its
/// covariance ties to what the robot says; target poses count by theirs. Poses that do not fit are
/// left out, the worst first, with the reason.
/// @param robot_poses, target_poses of the same length, in the same order.
/// @return error with value and limit where the poses cannot tell the hand-eye: too few, too small
/// rotations, parallel axes, a singular system; numbers that are not finite. A result that misses a
/// limit is returned with its verdict.
/// Ref: Park & Martin, "Robot sensor calibration: solving AX = XB on the Euclidean group", TRA
/// 10(5), 1994; Daniilidis, "Hand-eye calibration using dual quaternions", IJRR 18(3), 1999;
/// science 4.4.
[[nodiscard]] Result<HandEyeResult> CalibrateHandEye(const std::vector<DevicePose>& robot_poses,
                                                     const std::vector<TargetPose>& target_poses,
                                                     HandEyeMount mount,
                                                     const HandEyeConfig& config);

/// A target and the devices that saw it, for calibrations that use its points.
struct TargetView {
  CalibrationTarget target;
  CellCalibration devices;  ///< a projector of width 0: there is none
};

/// The same, refined on the points of the target in the camera and, where seen, the projector. The
/// lens models are taken as exact, but for what `refine_lens` frees.
/// @param sightings of the same length as robot_poses, in the same order.
/// @return also an error for sightings whose orientation is assumed, since the target then is
/// another one in every picture.
[[nodiscard]] Result<HandEyeResult> CalibrateHandEye(const std::vector<DevicePose>& robot_poses,
                                                     const std::vector<TargetSighting>& sightings,
                                                     const TargetView& view, HandEyeMount mount,
                                                     const HandEyeConfig& config);

}  // namespace fringe_fusion
