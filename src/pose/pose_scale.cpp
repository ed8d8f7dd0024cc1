#include "fringe_fusion/pose/pose_scale.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "common/constants.hpp"
#include "common/dense.hpp"

namespace fringe_fusion {
namespace {

Status CheckMotions(const std::vector<MotionPair>& motions) {
  constexpr double kMinAxisDeg = 2.0;
  if (motions.size() < 2) {
    return Fail("scale: {} motions, at least 2 with different axes are needed", motions.size());
  }
  for (std::size_t i = 0; i < motions.size(); ++i) {
    if (!motions[i].T_tool0_tool1.matrix().allFinite() ||
        !motions[i].T_camera0_camera1.matrix().allFinite()) {
      return Fail("scale: motion {} has a value that is not finite", i);
    }
  }
  double widest_deg = 0.0;
  for (const MotionPair& a : motions) {
    for (const MotionPair& b : motions) {
      const Eigen::Vector3d u = LogRotation(a.T_tool0_tool1.linear()).stableNormalized();
      const Eigen::Vector3d v = LogRotation(b.T_tool0_tool1.linear()).stableNormalized();
      widest_deg = std::max(widest_deg, kDegPerRad * std::asin(std::min(1.0, u.cross(v).norm())));
    }
  }
  if (!(widest_deg > kMinAxisDeg)) {
    return Fail(
        "scale: the rotation axes of {} motions differ by {:.2g} deg, limit {:.2g}: turns "
        "about one axis tell no length; tilt the tool, or give a baseline or known length",
        motions.size(), widest_deg, kMinAxisDeg);
  }
  return {};
}

/// R_X = (M^T M)^{-1/2} M^T with M = sum of beta alpha^T, by singular values.
Eigen::Matrix3d SolveRotation(const std::vector<MotionPair>& motions) {
  Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
  for (const MotionPair& motion : motions) {
    M += LogRotation(motion.T_camera0_camera1.linear()) *
         LogRotation(motion.T_tool0_tool1.linear()).transpose();
  }
  const dense::SingularValues svd = dense::DecomposeSingular(M);
  const Eigen::Matrix3d U = svd.U;
  const Eigen::Matrix3d V = svd.V;
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  // Two axes leave the sign of the third direction to the determinant.
  signs.z() = (V * U.transpose()).determinant();
  return V * signs.asDiagonal() * U.transpose();
}

}  // namespace

Result<MetricScale> ScaleFromLength(double estimated, double sigma_estimated, double true_m,
                                    double sigma_m) {
  if (!(estimated > 0.0) || !(true_m > 0.0) || !std::isfinite(estimated + true_m)) {
    return Fail("scale: lengths {} and {} m must be positive", estimated, true_m);
  }
  if (!(sigma_estimated >= 0.0) || !(sigma_m >= 0.0) || !std::isfinite(sigma_estimated + sigma_m)) {
    return Fail("scale: sigmas {} and {} m must not be negative", sigma_estimated, sigma_m);
  }
  const double scale = true_m / estimated;
  return MetricScale{scale, scale * std::hypot(sigma_estimated / estimated, sigma_m / true_m)};
}

Result<MotionScale> ScaleFromMotion(const std::vector<MotionPair>& motions) {
  constexpr double kMaxCondition = 1e8;
  if (Status status = CheckMotions(motions); !status) return Forward(status);
  const Eigen::Matrix3d R_X = SolveRotation(motions);
  const auto rows = static_cast<Eigen::Index>(3 * motions.size());
  Eigen::MatrixXd A(rows, 4);
  Eigen::VectorXd b(rows);
  for (std::size_t i = 0; i < motions.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(3 * i);
    const Transform& tool = motions[i].T_tool0_tool1;
    A.block<3, 3>(at, 0) = tool.linear() - Eigen::Matrix3d::Identity();
    A.block<3, 1>(at, 3) = -R_X * motions[i].T_camera0_camera1.translation();
    b.segment<3>(at) = -tool.translation();
  }
  const dense::SingularValues svd = dense::DecomposeSingular(A);
  const double condition = svd.values[0] / svd.values[3];
  if (!(condition <= kMaxCondition)) {
    return Fail(
        "scale: {} motions leave scale and mounting open (condition {:.2g}, limit {:.2g}): "
        "the camera must also be moved along",
        motions.size(), condition, kMaxCondition);
  }
  const Eigen::Vector4d x = dense::LeastSquares(A, b);
  const double squared = (dense::Product(A, x) - b).squaredNorm();
  MotionScale out;
  out.scale.scale = x[3];
  if (!(x[3] > 0.0)) {
    return Fail(
        "scale: {} m per unit from {} motions must be positive: the motions do not belong "
        "together",
        x[3], motions.size());
  }
  // (A^T A)^-1 = V diag(values)^-2 V^T.
  const double variance = svd.V.row(3).transpose().cwiseQuotient(svd.values).squaredNorm();
  const double dof = std::max(1.0, static_cast<double>(rows - 4));
  out.scale.sigma = std::sqrt(squared / dof * variance);
  out.rms_m = std::sqrt(squared / static_cast<double>(rows));
  out.T_tool_camera.linear() = R_X;
  out.T_tool_camera.translation() = x.head<3>();
  return out;
}

}  // namespace fringe_fusion
