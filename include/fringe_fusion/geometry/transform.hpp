#pragma once

#include <Eigen/Geometry>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// T_a_b maps coordinates of frame b into frame a: p_a = T_a_b * p_b.
using Transform = Eigen::Isometry3d;

/// Rotation matrix of a rotation vector [rad] (Rodrigues).
[[nodiscard]] Eigen::Matrix3d ExpRotation(const Eigen::Vector3d& rotation_rad);

/// Rotation vector [rad], norm at most pi, of a rotation matrix.
[[nodiscard]] Eigen::Vector3d LogRotation(const Eigen::Matrix3d& R);

/// The least rotation that turns one direction into another; lengths do not matter. Opposite
/// directions: by pi about an axis across them.
[[nodiscard]] Eigen::Matrix3d RotationBetween(const Eigen::Vector3d& from,
                                              const Eigen::Vector3d& to);

/// Exponential of SE(3). xi = (rotation [rad], translation part [m]); a pose is perturbed on the
/// right, T Exp(xi), and its 6x6 covariance is that of xi in this order.
/// Ref: Barfoot, State Estimation for Robotics, 2017, eq. 7.86 with rotation first.
[[nodiscard]] Transform Exp(const Vector6d& xi);

/// Inverse of Exp.
[[nodiscard]] Vector6d Log(const Transform& T);

/// Adjoint: T Exp(xi) = Exp(Adjoint(T) xi) T, order rotation, translation.
[[nodiscard]] Matrix6d Adjoint(const Transform& T);

/// Cross product matrix: Hat(a) * b = a x b.
[[nodiscard]] Eigen::Matrix3d Hat(const Eigen::Vector3d& a);

/// Builds a transform from file values.
/// @param quaternion_xyzw unit within 1e-3 (then normalised).
/// @return error when a value is not finite or the quaternion is not of unit length.
[[nodiscard]] Result<Transform> MakeTransform(const Eigen::Vector3d& translation_m,
                                              const Eigen::Vector4d& quaternion_xyzw);

/// Unit quaternion (x, y, z, w) of the rotation of T with w >= 0.
[[nodiscard]] Eigen::Vector4d QuaternionXyzw(const Transform& T);

}  // namespace fringe_fusion
