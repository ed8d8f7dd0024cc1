#include "fringe_fusion/pose/view.hpp"

#include "common/dense.hpp"

namespace fringe_fusion {

const char* PoseSourceName(PoseSource source) {
  switch (source) {
    case PoseSource::kNone:
      return "none";
    case PoseSource::kFile:
      return "file";
    case PoseSource::kTf:
      return "tf";
    case PoseSource::kEpipolar:
      return "epipolar";
    case PoseSource::kRegistration:
      return "registration";
  }
  return "unknown";
}

Matrix6d PoseCovariance(double sigma_rotation_rad, double sigma_translation_m) {
  Vector6d variance;
  variance.head<3>().setConstant(sigma_rotation_rad * sigma_rotation_rad);
  variance.tail<3>().setConstant(sigma_translation_m * sigma_translation_m);
  return variance.asDiagonal();
}

Status Validate(const View& view) {
  const std::string owner = fmt::format("view {} ({})", view.id, view.name);
  const Transform& T = view.pose.T_object_camera;
  if (view.pose.source == PoseSource::kNone) return Fail("{}: no pose", owner);
  if (!T.matrix().allFinite()) return Fail("{}: pose has a value that is not finite", owner);
  const double orthogonality =
      (T.linear().transpose() * T.linear() - Eigen::Matrix3d::Identity()).norm();
  if (!(orthogonality < 1e-3) || !(T.linear().determinant() > 0.0)) {
    return Fail("{}: rotation is off by {} from orthonormal, limit 0.001", owner, orthogonality);
  }
  if (!view.pose.covariance.allFinite()) return Fail("{}: covariance is not finite", owner);
  const Vector6d values = dense::SymmetricEigenvalues(view.pose.covariance);
  if (!(values[0] >= -1e-9 * (values[5] > 0.0 ? values[5] : 1.0))) {
    return Fail("{}: covariance has the negative eigenvalue {}", owner, values[0]);
  }
  if (CountValid(view.range) == 0) return Fail("{}: no valid point", owner);
  return {};
}

}  // namespace fringe_fusion
