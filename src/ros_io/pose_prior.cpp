#include "fringe_fusion/ros_io/pose_prior.hpp"

#include "common/constants.hpp"

namespace fringe_fusion::ros_io {

Pose PriorPose(const Transform& T_object_camera, const PosePriorConfig& config, PoseSource source) {
  constexpr double kMPerMm = 1e-3;
  Vector6d sigma;
  for (int i = 0; i < 3; ++i) {
    const auto axis = static_cast<std::size_t>(i);
    sigma[i] = config.rotation_sigma_deg[axis] * kRadPerDeg;
    sigma[3 + i] = config.translation_sigma_mm[axis] * kMPerMm;
  }
  Pose pose;
  pose.T_object_camera = T_object_camera;
  pose.covariance = sigma.array().square().matrix().asDiagonal();
  pose.source = source;
  if (config.in_object_frame) {
    // Exp(xi) T = T Exp(Adjoint(T^-1) xi): the error about the object's axes, seen from the camera.
    const Matrix6d A = Adjoint(T_object_camera.inverse());
    const Matrix6d turned = A * pose.covariance * A.transpose();
    // Rounding must not make it asymmetric: files and solvers check that.
    pose.covariance = 0.5 * (turned + turned.transpose());
  }
  return pose;
}

}  // namespace fringe_fusion::ros_io
