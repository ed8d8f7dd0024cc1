#include "dot_image.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

namespace fringe_fusion::bundle {
namespace {

/// Step of the differences, in normalised coordinates: distortion is a polynomial of order one.
constexpr double kStep = 1e-4;

/// Derivative of the pixel by the normalised coordinates.
Eigen::Matrix2d PixelByNormalized(const CameraModel& model, const Eigen::Vector2d& normalized) {
  return ProjectWithJacobian(model, normalized.homogeneous()).jacobian.leftCols<2>();
}

}  // namespace

Eigen::Vector2d LensShiftOfDot(const CameraModel& model, const Eigen::Vector3d& point_camera,
                               const Eigen::Matrix3d& R_camera_target, double radius_m) {
  const bool is_straight = std::all_of(model.distortion.begin(), model.distortion.end(),
                                       [](double k) { return k == 0.0; });
  if (is_straight) return Eigen::Vector2d::Zero();
  const Eigen::Vector2d n = point_camera.hnormalized();
  const Eigen::Matrix<double, 2, 3> by_point =
      (Eigen::Matrix<double, 2, 3>() << 1.0, 0.0, -n.x(), 0.0, 1.0, -n.y()).finished() /
      point_camera.z();
  const Eigen::Matrix2d by_plane = by_point * R_camera_target.leftCols<2>();
  // Second moments of a disc of radius r: r^2 / 4.
  const Eigen::Matrix2d M = 0.25 * radius_m * radius_m * by_plane * by_plane.transpose();
  std::array<Eigen::Matrix2d, 2> slopes;  // d_i J_P
  Eigen::Vector2d log_slope;              // d_i ln |J_P|
  for (Eigen::Index i = 0; i < 2; ++i) {
    const Eigen::Vector2d step = kStep * Eigen::Vector2d::Unit(i);
    const Eigen::Matrix2d up = PixelByNormalized(model, n + step);
    const Eigen::Matrix2d down = PixelByNormalized(model, n - step);
    slopes[static_cast<std::size_t>(i)] = (up - down) / (2.0 * kStep);
    log_slope[i] = std::log(std::abs(up.determinant() / down.determinant())) / (2.0 * kStep);
  }
  Eigen::Vector2d shift = PixelByNormalized(model, n) * (M * log_slope);
  for (Eigen::Index i = 0; i < 2; ++i) {
    shift += 0.5 * slopes[static_cast<std::size_t>(i)] * M.row(i).transpose();
  }
  return shift;
}

}  // namespace fringe_fusion::bundle
