#include "hand_eye_start.hpp"

#include <cmath>

#include "common/constants.hpp"
#include "common/dense.hpp"

namespace fringe_fusion::chain {
namespace {

constexpr double kMaxMotionRad = 170.0 * kRadPerDeg;
constexpr double kMinMotionRad = 0.5 * kRadPerDeg;

/// Scalar part first, not negative.
struct MotionQuaternion {
  Eigen::Vector4d real = Eigen::Vector4d::UnitX();
  Eigen::Vector4d dual = Eigen::Vector4d::Zero();
};

MotionQuaternion DualOf(const Transform& T) {
  const Eigen::Vector4d xyzw = QuaternionXyzw(T);
  MotionQuaternion q;
  q.real << xyzw[3], xyzw.head<3>();
  const Eigen::Vector3d v = q.real.tail<3>();
  const Eigen::Vector3d t = T.translation();
  // 1/2 (0, t) q
  q.dual << -0.5 * t.dot(v), 0.5 * (q.real[0] * t + t.cross(v));
  return q;
}

Transform TransformOf(const Eigen::Vector4d& real, const Eigen::Vector4d& dual) {
  Transform T = Transform::Identity();
  const Eigen::Quaterniond q(real[0], real[1], real[2], real[3]);
  T.linear() = q.normalized().toRotationMatrix();
  // 2 dual conj(real)
  const Eigen::Vector3d v = real.tail<3>();
  T.translation() =
      2.0 * (-dual[0] * v + real[0] * dual.tail<3>() - Eigen::Vector3d(dual.tail<3>()).cross(v)) /
      real.squaredNorm();
  return T;
}

/// Rows of eq. 31 of one motion.
Eigen::Matrix<double, 6, 8> DualRows(const MotionPair& motion) {
  const MotionQuaternion a = DualOf(motion.A);
  const MotionQuaternion b = DualOf(motion.B);
  const Eigen::Vector3d real_difference = (a.real - b.real).tail<3>();
  const Eigen::Vector3d dual_difference = (a.dual - b.dual).tail<3>();
  const Eigen::Matrix3d real_sum = Hat((a.real + b.real).tail<3>());
  const Eigen::Matrix3d dual_sum = Hat((a.dual + b.dual).tail<3>());
  Eigen::Matrix<double, 6, 8> rows = Eigen::Matrix<double, 6, 8>::Zero();
  rows.block<3, 1>(0, 0) = real_difference;
  rows.block<3, 3>(0, 1) = real_sum;
  rows.block<3, 1>(3, 0) = dual_difference;
  rows.block<3, 3>(3, 1) = dual_sum;
  rows.block<3, 1>(3, 4) = real_difference;
  rows.block<3, 3>(3, 5) = real_sum;
  return rows;
}

/// Rotations that determine a rotation have a second axis.
bool HaveTwoAxes(const Eigen::VectorXd& singular_values) {
  return singular_values[1] > 1e-9 * singular_values[0] && singular_values[1] > 0.0;
}

}  // namespace

std::vector<MotionPair> MotionPairs(const std::vector<Transform>& T_camera_target,
                                    const std::vector<Transform>& T_carrier_other) {
  std::vector<MotionPair> motions;
  for (std::size_t i = 0; i < T_camera_target.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      MotionPair motion;
      motion.A = T_camera_target[i] * T_camera_target[j].inverse();
      motion.B = T_carrier_other[i] * T_carrier_other[j].inverse();
      const double angle = LogRotation(motion.B.linear()).norm();
      const double seen_angle = LogRotation(motion.A.linear()).norm();
      if (angle > kMaxMotionRad || seen_angle > kMaxMotionRad || angle < kMinMotionRad) continue;
      motions.push_back(motion);
    }
  }
  return motions;
}

std::optional<Transform> ParkMartin(const std::vector<MotionPair>& motions) {
  Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
  for (const MotionPair& motion : motions) {
    M += LogRotation(motion.A.linear()) * LogRotation(motion.B.linear()).transpose();
  }
  const dense::SingularValues svd = dense::DecomposeSingular(M);
  if (!HaveTwoAxes(svd.values)) return std::nullopt;
  const Eigen::Matrix3d U = svd.U;
  const Eigen::Matrix3d V = svd.V;
  Eigen::Matrix3d sign = Eigen::Matrix3d::Identity();
  sign(2, 2) = (U * V.transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  Transform X = Transform::Identity();
  X.linear() = U * sign * V.transpose();
  // (R_A - I) t_X = R_X t_B - t_A
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const MotionPair& motion : motions) {
    const Eigen::Matrix3d row = motion.A.linear() - Eigen::Matrix3d::Identity();
    normal += row.transpose() * row;
    right += row.transpose() * (X.linear() * motion.B.translation() - motion.A.translation());
  }
  X.translation() = Eigen::Vector3d(dense::SolveSymmetric(normal, right));
  if (!X.matrix().allFinite()) return std::nullopt;
  return X;
}

std::optional<Transform> DualQuaternion(const std::vector<MotionPair>& motions) {
  Eigen::Matrix<double, 8, 8> normal = Eigen::Matrix<double, 8, 8>::Zero();
  for (const MotionPair& motion : motions) {
    const Eigen::Matrix<double, 6, 8> rows = DualRows(motion);
    normal += rows.transpose() * rows;
  }
  const dense::SymmetricEigen eigen = dense::DecomposeSymmetric(normal);
  // Parallel axes leave more than the two directions of a screw open.
  if (!(eigen.values[2] > 1e-9 * eigen.values[7])) return std::nullopt;
  const Eigen::Matrix<double, 8, 1> first = eigen.vectors.col(0);
  const Eigen::Matrix<double, 8, 1> second = eigen.vectors.col(1);
  const Eigen::Vector4d u1 = first.head<4>();
  const Eigen::Vector4d w1 = first.tail<4>();
  const Eigen::Vector4d u2 = second.head<4>();
  const Eigen::Vector4d w2 = second.tail<4>();
  // q = l1 first + l2 second is a unit dual quaternion: real . dual = 0, |real| = 1.
  const double a = u1.dot(w1);
  const double b = u1.dot(w2) + u2.dot(w1);
  const double c = u2.dot(w2);
  // Angle of (l1, l2) on the circle: a cos^2 + b cos sin + c sin^2 = 0.
  const double amplitude = std::hypot(0.5 * (a - c), 0.5 * b);
  if (!(amplitude > 0.0)) return std::nullopt;
  const double mean = std::min(1.0, std::max(-1.0, -0.5 * (a + c) / amplitude));
  const double phase = std::atan2(0.5 * b, 0.5 * (a - c));
  Eigen::Vector4d best_real = Eigen::Vector4d::Zero();
  Eigen::Vector4d best_dual = Eigen::Vector4d::Zero();
  for (const double sign : {1.0, -1.0}) {
    const double angle = 0.5 * (phase + sign * std::acos(mean));
    const Eigen::Vector4d real = std::cos(angle) * u1 + std::sin(angle) * u2;
    const Eigen::Vector4d dual = std::cos(angle) * w1 + std::sin(angle) * w2;
    if (real.norm() <= best_real.norm()) continue;
    best_real = real;
    best_dual = dual;
  }
  if (!(best_real.norm() > 1e-9)) return std::nullopt;
  return TransformOf(best_real, best_dual);
}

}  // namespace fringe_fusion::chain
