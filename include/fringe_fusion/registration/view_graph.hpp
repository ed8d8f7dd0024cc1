#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fringe_fusion/pose/view.hpp"

namespace fringe_fusion {

/// What is known about two views beside their surfaces: an epipolar or phase tie, a measured move.
struct ViewTie {
  int first = 0;  ///< view ids
  int second = 0;
  Transform T_first_second = Transform::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< right perturbation, order rotation, translation
  PoseSource source = PoseSource::kEpipolar;
};

/// A mounting that is solved for together with the poses.
struct Mounting {
  Transform T = Transform::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< right perturbation; only with `known`
  bool known = false;  ///< false: `T` is ignored and a start is computed from the views
};

/// Turntable or robot arm that carries the camera or the object, with unknown mounting:
///   T_object_camera = T_object_base * T_base_flange(view) * T_flange_camera.
/// A turntable with axis z of its base: T_base_flange = RotZ(-angle), see TurntableChain. A robot
/// with the scanner in its hand: the forward kinematics, and T_flange_camera is the hand-eye.
struct DeviceChain {
  struct Reading {
    int view = 0;  ///< id
    Transform T_base_flange = Transform::Identity();
  };
  std::string name = "turntable";
  std::vector<Reading> readings;
  Matrix6d covariance = Matrix6d::Zero();  ///< of one reading, right perturbation of T_base_flange
  Mounting object_base;
  Mounting flange_camera;
};

/// Readings of a turntable whose axis in the object frame is unknown.
/// @param angles_rad of the table at every view, in the order of view_ids.
/// @param sigma_angle_rad, sigma_m repeatability of angle and of all other directions.
[[nodiscard]] DeviceChain TurntableChain(const std::vector<int>& view_ids,
                                         const std::vector<double>& angles_rad,
                                         double sigma_angle_rad, double sigma_m);

/// All that is known about where the views of one object were taken from. The pose of a view with
/// zero covariance is held, unless no view has a covariance: then the first view is held.
struct ViewGraph {
  std::vector<View> views;
  std::vector<ViewTie> ties;
  std::optional<DeviceChain> chain;
};

/// @return error naming the first view, tie or reading that is malformed: fewer than two views, an
/// id twice or unknown, a pose or covariance that is not valid.
[[nodiscard]] Status Validate(const ViewGraph& graph);

/// Solved mounting of a device.
struct SolvedChain {
  std::string name;
  Transform T_object_base = Transform::Identity();
  Transform T_flange_camera = Transform::Identity();
  Matrix6d covariance_object_base = Matrix6d::Zero();    ///< right perturbation
  Matrix6d covariance_flange_camera = Matrix6d::Zero();  ///< right perturbation
  double rms_sigma = 0.0;  ///< of the readings against the solved poses, in standard deviations
};

/// A line in space with the accuracy of its direction and position.
struct AxisLine {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< nearest to the origin of the object [m]
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
  double sigma_direction_rad = 0.0;  ///< rms of both components
  double sigma_point_m = 0.0;        ///< rms of both components, where the base has its origin
};

/// Axis of a turntable (z of the base) in the object frame.
[[nodiscard]] AxisLine TurntableAxis(const SolvedChain& chain);

}  // namespace fringe_fusion
