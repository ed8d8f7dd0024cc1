#include "fringe_fusion/geometry/transform.hpp"

#include <cmath>

namespace fringe_fusion {
namespace {

// Left Jacobian of SO(3), Barfoot eq. 7.37: the translation of Exp is J(rotation) * translation.
Eigen::Matrix3d LeftJacobian(const Eigen::Vector3d& rotation_rad) {
  const double angle = rotation_rad.norm();
  const Eigen::Matrix3d hat = Hat(rotation_rad);
  if (angle < 1e-6) return Eigen::Matrix3d::Identity() + 0.5 * hat + hat * hat / 6.0;
  const double a2 = angle * angle;
  return Eigen::Matrix3d::Identity() + (1.0 - std::cos(angle)) / a2 * hat +
         (angle - std::sin(angle)) / (a2 * angle) * hat * hat;
}

}  // namespace

Eigen::Matrix3d Hat(const Eigen::Vector3d& a) {
  Eigen::Matrix3d hat;
  hat << 0.0, -a.z(), a.y(), a.z(), 0.0, -a.x(), -a.y(), a.x(), 0.0;
  return hat;
}

Eigen::Matrix3d ExpRotation(const Eigen::Vector3d& rotation_rad) {
  const double angle = rotation_rad.norm();
  const Eigen::Matrix3d hat = Hat(rotation_rad);
  if (angle < 1e-8) return Eigen::Matrix3d::Identity() + hat + 0.5 * hat * hat;
  return Eigen::AngleAxisd(angle, rotation_rad / angle).toRotationMatrix();
}

Eigen::Vector3d LogRotation(const Eigen::Matrix3d& R) {
  // By the quaternion: stable near 0 and near pi, where trace formulas lose digits.
  Eigen::Quaterniond q(R);
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  const double sin_half = q.vec().norm();
  if (sin_half < 1e-12) return 2.0 * q.vec();
  return 2.0 * std::atan2(sin_half, q.w()) / sin_half * q.vec();
}

Eigen::Matrix3d RotationBetween(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to).toRotationMatrix();
}

Transform Exp(const Vector6d& xi) {
  Transform T = Transform::Identity();
  T.linear() = ExpRotation(xi.head<3>());
  T.translation() = LeftJacobian(xi.head<3>()) * xi.tail<3>();
  return T;
}

Vector6d Log(const Transform& T) {
  Vector6d xi;
  xi.head<3>() = LogRotation(T.linear());
  const Eigen::Matrix3d jacobian = LeftJacobian(xi.head<3>());
  xi.tail<3>() = jacobian.partialPivLu().solve(T.translation());
  return xi;
}

Matrix6d Adjoint(const Transform& T) {
  Matrix6d adjoint = Matrix6d::Zero();
  adjoint.topLeftCorner<3, 3>() = T.linear();
  adjoint.bottomRightCorner<3, 3>() = T.linear();
  adjoint.bottomLeftCorner<3, 3>() = Hat(T.translation()) * T.linear();
  return adjoint;
}

Result<Transform> MakeTransform(const Eigen::Vector3d& translation_m,
                                const Eigen::Vector4d& quaternion_xyzw) {
  if (!translation_m.allFinite() || !quaternion_xyzw.allFinite()) {
    return Fail("transform has a value that is not finite");
  }
  const double norm = quaternion_xyzw.norm();
  if (!(std::abs(norm - 1.0) <= 1e-3)) {
    return Fail("quaternion has length {}, must be 1 within 0.001", norm);
  }
  Transform T = Transform::Identity();
  T.linear() = Eigen::Quaterniond(quaternion_xyzw[3], quaternion_xyzw[0], quaternion_xyzw[1],
                                  quaternion_xyzw[2])
                   .normalized()
                   .toRotationMatrix();
  T.translation() = translation_m;
  return T;
}

Eigen::Vector4d QuaternionXyzw(const Transform& T) {
  Eigen::Quaterniond q(T.linear());
  q.normalize();
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  return q.coeffs();
}

}  // namespace fringe_fusion
