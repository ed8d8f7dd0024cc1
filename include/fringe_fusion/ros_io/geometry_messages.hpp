#pragma once

#include <geometry_msgs/Pose.h>
#include <geometry_msgs/PoseWithCovariance.h>
#include <geometry_msgs/Transform.h>
#include <sensor_msgs/CameraInfo.h>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/geometry/camera_model.hpp"
#include "fringe_fusion/geometry/transform.hpp"
#include "fringe_fusion/pose/view.hpp"

namespace fringe_fusion::ros_io {

/// plumb_bob CameraInfo of a camera or projector; the header is left to the caller.
[[nodiscard]] sensor_msgs::CameraInfo ToMessage(const CameraModel& model);
/// @param owner names the topic in the message of an error.
/// @return error for another distortion model, a skewed K, or an invalid model.
[[nodiscard]] Result<CameraModel> FromMessage(const sensor_msgs::CameraInfo& message,
                                              const std::string& owner);

[[nodiscard]] geometry_msgs::Pose ToPoseMessage(const Transform& T);
[[nodiscard]] geometry_msgs::Transform ToTransformMessage(const Transform& T);
/// @return error when a value is not finite or the quaternion is not of unit length.
[[nodiscard]] Result<Transform> FromMessage(const geometry_msgs::Pose& message);
[[nodiscard]] Result<Transform> FromMessage(const geometry_msgs::Transform& message);

/// Core covariance (rotation, translation of the right perturbation T Exp(xi)) in ROS order:
/// (x, y, z, rotation about the fixed axes of the parent frame).
[[nodiscard]] Matrix6d ToRosCovariance(const Matrix6d& covariance, const Transform& T);
/// Inverse of ToRosCovariance.
[[nodiscard]] Matrix6d FromRosCovariance(const Matrix6d& covariance_ros, const Transform& T);

/// The pose with its covariance; the source does not fit into this message.
[[nodiscard]] geometry_msgs::PoseWithCovariance ToMessage(const Pose& pose);
/// @param source as it was carried beside the pose, see PoseSourceName.
/// @return error when pose or covariance is not finite, or the source is unknown.
[[nodiscard]] Result<Pose> FromMessage(const geometry_msgs::PoseWithCovariance& message,
                                       const std::string& source);

}  // namespace fringe_fusion::ros_io
