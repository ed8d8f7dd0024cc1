#include "target_homography.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "common/dense.hpp"

namespace fringe_fusion::internal {
namespace {

/// Similarity that puts points about the origin at a mean distance of sqrt(2).
Eigen::Matrix3d Normalising(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& p : points) mean += p / static_cast<double>(points.size());
  double distance = 0.0;
  for (const Eigen::Vector2d& p : points) {
    distance += (p - mean).norm() / static_cast<double>(points.size());
  }
  const double scale = std::sqrt(2.0) / std::max(distance, 1e-12);
  Eigen::Matrix3d normalising;
  normalising << scale, 0.0, -scale * mean.x(), 0.0, scale, -scale * mean.y(), 0.0, 0.0, 1.0;
  return normalising;
}

}  // namespace

Eigen::Vector2d Homography::Map(const Eigen::Vector2d& point) const {
  return (H * point.homogeneous()).hnormalized();
}

Eigen::Matrix2d Homography::Jacobian(const Eigen::Vector2d& point) const {
  const Eigen::Vector3d mapped = H * point.homogeneous();
  const Eigen::Vector2d pixel = mapped.hnormalized();
  return (H.topLeftCorner<2, 2>() - pixel * H.bottomLeftCorner<1, 2>()) / mapped.z();
}

std::optional<Homography> FitTargetHomography(const TargetSighting& sighting,
                                              const CalibrationTarget& target) {
  if (sighting.points.size() < 4) return std::nullopt;
  const std::vector<Eigen::Vector3d> nominal = TargetPoints(target);
  std::vector<Eigen::Vector2d> from;
  std::vector<Eigen::Vector2d> to;
  for (const PointSighting& point : sighting.points) {
    from.emplace_back(nominal[static_cast<std::size_t>(point.point)].head<2>());
    to.push_back(point.pixel_camera);
  }
  const Eigen::Matrix3d normal_from = Normalising(from);
  const Eigen::Matrix3d normal_to = Normalising(to);
  Eigen::Matrix<double, 9, 9> squares;
  squares.setZero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector3d a = normal_from * from[i].homogeneous();
    const Eigen::Vector2d b = (normal_to * to[i].homogeneous()).hnormalized();
    Eigen::Matrix<double, 2, 9> rows;
    rows << a.transpose(), Eigen::RowVector3d::Zero(), -b.x() * a.transpose(),
        Eigen::RowVector3d::Zero(), a.transpose(), -b.y() * a.transpose();
    squares += rows.transpose() * rows;
  }
  const dense::SymmetricEigen eigen = dense::DecomposeSymmetric(squares);
  // A second small eigenvalue: the points lie on a line.
  if (!(eigen.values[1] > 1e-9 * eigen.values[8])) return std::nullopt;
  const Eigen::Matrix<double, 9, 1> h = eigen.vectors.col(0);
  Eigen::Matrix3d normalised;
  normalised << h.segment<3>(0).transpose(), h.segment<3>(3).transpose(),
      h.segment<3>(6).transpose();
  Homography homography;
  homography.H = normal_to.inverse() * normalised * normal_from;
  if (!homography.H.allFinite()) return std::nullopt;
  return homography;
}

Eigen::Vector2d EllipseCentre(const Homography& homography, const Eigen::Vector2d& point,
                              double radius_m) {
  Eigen::Matrix3d to_point = Eigen::Matrix3d::Identity();
  to_point.topRightCorner<2, 1>() = point;
  const Eigen::Matrix3d H = homography.H * to_point;
  const Eigen::Vector3d dual_conic(radius_m * radius_m, radius_m * radius_m, -1.0);
  const Eigen::Vector3d centre = H * (dual_conic.asDiagonal() * H.row(2).transpose());
  return centre.hnormalized();
}

}  // namespace fringe_fusion::internal
