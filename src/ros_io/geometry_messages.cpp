#include "fringe_fusion/ros_io/geometry_messages.hpp"

#include <sensor_msgs/distortion_models.h>

#include <algorithm>

namespace fringe_fusion::ros_io {
namespace {

Result<PoseSource> SourceFromName(const std::string& name) {
  for (const PoseSource source : {PoseSource::kNone, PoseSource::kFile, PoseSource::kTf,
                                  PoseSource::kEpipolar, PoseSource::kRegistration}) {
    if (name == PoseSourceName(source)) return source;
  }
  return Fail("pose source '{}' must be none, file, tf, epipolar or registration", name);
}

}  // namespace

sensor_msgs::CameraInfo ToMessage(const CameraModel& model) {
  sensor_msgs::CameraInfo message;
  message.width = static_cast<std::uint32_t>(model.width);
  message.height = static_cast<std::uint32_t>(model.height);
  message.distortion_model = sensor_msgs::distortion_models::PLUMB_BOB;
  message.D.assign(model.distortion.begin(), model.distortion.end());
  message.K = {model.fx, 0.0, model.cx, 0.0, model.fy, model.cy, 0.0, 0.0, 1.0};
  message.R = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  message.P = {model.fx, 0.0, model.cx, 0.0, 0.0, model.fy, model.cy, 0.0, 0.0, 0.0, 1.0, 0.0};
  return message;
}

Result<CameraModel> FromMessage(const sensor_msgs::CameraInfo& message, const std::string& owner) {
  if (message.distortion_model != sensor_msgs::distortion_models::PLUMB_BOB ||
      message.D.size() != 5) {
    return Fail("{}: distortion model '{}' with {} coefficients must be plumb_bob with 5", owner,
                message.distortion_model, message.D.size());
  }
  if (!(message.K[1] == 0.0)) return Fail("{}: skew {} px must be 0", owner, message.K[1]);
  constexpr std::uint32_t kMaxSidePx = 1U << 16U;
  if (message.width > kMaxSidePx || message.height > kMaxSidePx) {
    return Fail("{}: size {} x {} px is beyond {}", owner, message.width, message.height,
                kMaxSidePx);
  }
  CameraModel model;
  model.width = static_cast<int>(message.width);
  model.height = static_cast<int>(message.height);
  model.fx = message.K[0];
  model.cx = message.K[2];
  model.fy = message.K[4];
  model.cy = message.K[5];
  std::copy(message.D.begin(), message.D.end(), model.distortion.begin());
  if (Status status = Validate(model, owner); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return model;
}

geometry_msgs::Pose ToPoseMessage(const Transform& T) {
  geometry_msgs::Pose message;
  const Eigen::Vector4d q = QuaternionXyzw(T);
  message.position.x = T.translation().x();
  message.position.y = T.translation().y();
  message.position.z = T.translation().z();
  message.orientation.x = q[0];
  message.orientation.y = q[1];
  message.orientation.z = q[2];
  message.orientation.w = q[3];
  return message;
}

geometry_msgs::Transform ToTransformMessage(const Transform& T) {
  const geometry_msgs::Pose pose = ToPoseMessage(T);
  geometry_msgs::Transform message;
  message.translation.x = pose.position.x;
  message.translation.y = pose.position.y;
  message.translation.z = pose.position.z;
  message.rotation = pose.orientation;
  return message;
}

Result<Transform> FromMessage(const geometry_msgs::Pose& message) {
  const auto& p = message.position;
  const auto& q = message.orientation;
  return MakeTransform({p.x, p.y, p.z}, {q.x, q.y, q.z, q.w});
}

Result<Transform> FromMessage(const geometry_msgs::Transform& message) {
  const auto& p = message.translation;
  const auto& q = message.rotation;
  return MakeTransform({p.x, p.y, p.z}, {q.x, q.y, q.z, q.w});
}

// To first order, T Exp(rho, tau) moves the origin by R tau and turns by R rho about the fixed
// axes, so both orders are linked by the block matrix [0 R; R 0].
Matrix6d ToRosCovariance(const Matrix6d& covariance, const Transform& T) {
  Matrix6d J = Matrix6d::Zero();
  J.block<3, 3>(0, 3) = T.linear();
  J.block<3, 3>(3, 0) = T.linear();
  const Matrix6d turned = J * covariance * J.transpose();
  return 0.5 * (turned + turned.transpose());  // rounding must not make it asymmetric
}

Matrix6d FromRosCovariance(const Matrix6d& covariance_ros, const Transform& T) {
  Matrix6d J = Matrix6d::Zero();
  J.block<3, 3>(0, 3) = T.linear().transpose();
  J.block<3, 3>(3, 0) = T.linear().transpose();
  const Matrix6d turned = J * covariance_ros * J.transpose();
  return 0.5 * (turned + turned.transpose());
}

geometry_msgs::PoseWithCovariance ToMessage(const Pose& pose) {
  geometry_msgs::PoseWithCovariance message;
  message.pose = ToPoseMessage(pose.T_object_camera);
  const Matrix6d covariance = ToRosCovariance(pose.covariance, pose.T_object_camera);
  for (int row = 0; row < 6; ++row) {
    for (int col = 0; col < 6; ++col) {
      message.covariance[static_cast<std::size_t>(6 * row + col)] = covariance(row, col);
    }
  }
  return message;
}

Result<Pose> FromMessage(const geometry_msgs::PoseWithCovariance& message,
                         const std::string& source) {
  const Result<PoseSource> known_source = SourceFromName(source);
  if (!known_source) return Forward(known_source);
  const Result<Transform> T = FromMessage(message.pose);
  if (!T) return Forward(T);
  Matrix6d covariance_ros;
  for (int row = 0; row < 6; ++row) {
    for (int col = 0; col < 6; ++col) {
      covariance_ros(row, col) = message.covariance[static_cast<std::size_t>(6 * row + col)];
    }
  }
  if (!covariance_ros.allFinite()) return Fail("pose covariance has a value that is not finite");
  Pose pose;
  pose.T_object_camera = *T;
  pose.covariance = FromRosCovariance(covariance_ros, *T);
  pose.source = *known_source;
  return pose;
}

}  // namespace fringe_fusion::ros_io
