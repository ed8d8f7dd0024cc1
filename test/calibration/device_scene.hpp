#pragma once

#include <Eigen/Core>
#include <random>
#include <string>
#include <vector>

#include "cell_scene.hpp"
#include "fringe_fusion/calibration/hand_eye.hpp"
#include "fringe_fusion/calibration/turntable_axis.hpp"

namespace fringe_fusion::test_support {

/// A transform by its rotation vector [deg] and translation [m].
[[nodiscard]] Transform TransformOf(const Eigen::Vector3d& rotation_deg,
                                    const Eigen::Vector3d& translation_m);

/// A right perturbation drawn with these standard deviations.
[[nodiscard]] Transform DrawPerturbation(std::mt19937& random, double sigma_rotation_rad,
                                         double sigma_translation_m);

/// Poses of a camera before a target for a hand-eye: tilts of 10 to 30 degrees in all directions,
/// rolled by up to 60 degrees both ways, about 0.6 m away.
[[nodiscard]] std::vector<Transform> HandEyeViews(const CalibrationTarget& target, int num,
                                                  unsigned seed);

/// A robot that carries a camera, or a target. Truth comes from products of these transforms alone.
struct RobotScene {
  HandEyeMount mount = HandEyeMount::kEyeInHand;
  Transform T_carrier_camera = TransformOf({20.0, -35.0, 100.0}, {0.06, -0.04, 0.11});
  Transform T_other_target = TransformOf({170.0, 10.0, 30.0}, {0.85, 0.12, 0.04});

  /// T_base_flange at which the camera sees the target so.
  [[nodiscard]] Transform FlangeFor(const Transform& T_camera_target) const;
};

struct DeviceNoise {
  double sigma_rotation_rad = 0.0;
  double sigma_translation_m = 0.0;
};

/// What the robot says, with its covariance; "pose 0", "pose 1", ...
[[nodiscard]] std::vector<DevicePose> ReadRobot(const RobotScene& scene,
                                                const std::vector<Transform>& T_camera_target,
                                                const DeviceNoise& noise, unsigned seed);

/// What the camera measures of the target's pose, with its covariance.
[[nodiscard]] std::vector<TargetPose> ReadTargets(const std::vector<Transform>& T_camera_target,
                                                  const DeviceNoise& noise, unsigned seed);

/// The error of a found transform in the perturbation that its covariance is of.
[[nodiscard]] Vector6d PerturbationTo(const Transform& truth, const Transform& found);

/// A target that lies on a table; the camera looks down at it from 50 degrees above the plate.
struct TableScene {
  Transform T_camera_base = TransformOf({140.0, 0.0, 0.0}, {0.01, 0.02, 0.65});
  Transform T_table_target = TransformOf({175.0, 0.0, 0.0}, {-0.10, 0.07, 0.01});

  [[nodiscard]] std::vector<Transform> TargetsAt(const std::vector<double>& angles_rad,
                                                 double sigma_wobble_rad, double sigma_runout_m,
                                                 double sigma_angle_rad, unsigned seed) const;
};

/// `num` stops over `arc_deg`, "stop 0", ...; a full turn leaves out the last one.
[[nodiscard]] std::vector<TurntableStop> TableStops(int num, double arc_deg);
[[nodiscard]] std::vector<double> AnglesOfStops(const std::vector<TurntableStop>& stops);

/// Angle between an axis found and the true one [rad], and how far the true axis passes from a
/// point of the found one [m].
struct AxisError {
  double direction_rad = 0.0;
  double distance_m = 0.0;
};
[[nodiscard]] AxisError ErrorOfAxis(const TableScene& scene, const TurntableResult& result);

}  // namespace fringe_fusion::test_support
