#include "fundamental.hpp"

#include <cmath>

#include "common/constants.hpp"
#include "common/dense.hpp"
#include "fringe_fusion/pose/self_calibration.hpp"

namespace fringe_fusion::epipolar {
namespace {

/// Similarity that brings points to mean 0 and rms distance sqrt(2).
Eigen::Matrix3d Normalizer(const std::vector<Ray>& rays, Eigen::Vector2d Ray::*point) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Ray& ray : rays) mean += ray.*point;
  mean /= static_cast<double>(rays.size());
  double squared = 0.0;
  for (const Ray& ray : rays) squared += (ray.*point - mean).squaredNorm();
  const double scale = std::sqrt(2.0 * static_cast<double>(rays.size()) / squared);
  Eigen::Matrix3d T;
  T << scale, 0.0, -scale * mean.x(), 0.0, scale, -scale * mean.y(), 0.0, 0.0, 1.0;
  return T;
}

}  // namespace

Eigen::Matrix3d EightPoint(const std::vector<Ray>& rays, const Eigen::Matrix3d& start) {
  using Matrix9 = Eigen::Matrix<double, 9, 9>;
  const Eigen::Matrix3d T_a = Normalizer(rays, &Ray::anchor);
  const Eigen::Matrix3d T_o = Normalizer(rays, &Ray::observed);
  Eigen::Matrix3d F = start;
  for (int round = 0; round < 3; ++round) {
    const double limit = 2.5 * RobustScale(rays, F);
    Matrix9 normal = Matrix9::Zero();
    for (const Ray& ray : rays) {
      if (!(std::abs(Residual(ray, F)) <= limit)) continue;
      const Eigen::Vector2d line = (F * ray.anchor.homogeneous()).head<2>();
      const double weight = 1.0 / line.dot(ray.covariance * line);
      const Eigen::Vector3d a = T_a * ray.anchor.homogeneous();
      const Eigen::Vector3d o = T_o * ray.observed.homogeneous();
      Eigen::Matrix<double, 9, 1> row;
      row << o.x() * a, o.y() * a, o.z() * a;
      normal += weight * row * row.transpose();
    }
    const Eigen::Matrix<double, 9, 1> f = dense::DecomposeSymmetric(normal).vectors.col(0);
    Eigen::Matrix3d scaled;
    scaled << f.segment<3>(0).transpose(), f.segment<3>(3).transpose(), f.segment<3>(6).transpose();
    const dense::SingularValues svd = dense::DecomposeSingular(scaled);
    const Eigen::Matrix3d U = svd.U;
    const Eigen::Matrix3d V = svd.V;
    const Eigen::Vector3d s(svd.values[0], svd.values[1], 0.0);
    F = T_o.transpose() * U * s.asDiagonal() * V.transpose() * T_a;
  }
  return F;
}

}  // namespace fringe_fusion::epipolar

namespace fringe_fusion {

Result<Eigen::Vector2d> FocalLengthsOf(const Eigen::Matrix3d& F,
                                       const Eigen::Vector2d& principal_anchor,
                                       const Eigen::Vector2d& principal_observed) {
  const Eigen::Vector3d p_a = principal_anchor.homogeneous();
  const Eigen::Vector3d p_o = principal_observed.homogeneous();
  const Eigen::Matrix3d I = Eigen::Vector3d(1.0, 1.0, 0.0).asDiagonal();
  // Bougnoux eq. 12 for the device on the right of F; the other one by transposing.
  const auto squared = [&I](const Eigen::Matrix3d& M, const Eigen::Vector3d& p_right,
                            const Eigen::Vector3d& p_left) {
    const Eigen::Matrix3d epipole = Hat(dense::DecomposeSingular(M).U.col(2));  // M^T e = 0
    const Eigen::RowVector3d left = p_left.transpose() * epipole * I * M;
    return -left.dot(p_right) * (p_right.dot(M.transpose() * p_left)) /
           (left * I * M.transpose() * p_left).value();
  };
  const double f_a2 = squared(F, p_a, p_o);
  const double f_o2 = squared(F.transpose(), p_o, p_a);
  if (!(f_a2 > 0.0) || !(f_o2 > 0.0) || !std::isfinite(f_a2) || !std::isfinite(f_o2)) {
    return Fail(
        "self-calibration: squared focal lengths {:.4g} and {:.4g} px^2 of the linear "
        "solution must be positive",
        f_a2, f_o2);
  }
  return Eigen::Vector2d(std::sqrt(f_a2), std::sqrt(f_o2));
}

double AxesOutOfPlaneDeg(const Transform& T_observed_anchor) {
  // In the observed frame: the axes and the direction between the centres.
  const Eigen::Vector3d axis_anchor = T_observed_anchor.linear().col(2);
  const Eigen::Vector3d axis_observed = Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d t = T_observed_anchor.translation().normalized();
  const double volume = std::abs(axis_observed.dot(axis_anchor.cross(t)));
  const double area = std::min(axis_anchor.cross(t).norm(), axis_observed.cross(t).norm());
  return kDegPerRad * std::asin(std::min(1.0, volume / std::max(area, 1e-12)));
}

}  // namespace fringe_fusion
