#pragma once

#include <Eigen/Core>
#include <array>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion {

/// Pinhole with Brown-Conrady distortion, shared by camera and projector (an inverse camera).
/// Pixel centres are at integers; frame: z forward, x right, y down.
/// Ref: OpenCV's plumb_bob model; science section 0: x_d = x (1 + k1 r2 + k2 r4 + k3 r6) + ...
struct CameraModel {
  int width = 0;
  int height = 0;
  double fx = 0.0;
  double fy = 0.0;
  double cx = 0.0;
  double cy = 0.0;
  std::array<double, 5> distortion{};  ///< k1, k2, p1, p2, k3
};

/// Checks size, focal lengths and finiteness.
/// @param owner name used in the message, e.g. "cell.yaml: camera".
[[nodiscard]] Status Validate(const CameraModel& model, const std::string& owner);

/// Pixel of a point in the device's frame. The point must have z > 0, otherwise NaN.
/// @param point_device [m].
[[nodiscard]] Eigen::Vector2d Project(const CameraModel& model,
                                      const Eigen::Vector3d& point_device);

/// Pixel and its 2x3 derivative with respect to the point [px/m].
struct Projection {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 2, 3> jacobian = Eigen::Matrix<double, 2, 3>::Zero();
};
[[nodiscard]] Projection ProjectWithJacobian(const CameraModel& model,
                                             const Eigen::Vector3d& point_device);

/// Distorted from undistorted normalised coordinates.
[[nodiscard]] Eigen::Vector2d Distort(const CameraModel& model, const Eigen::Vector2d& normalized);

/// Undistorted normalised coordinates (x, y) of a pixel, so that the ray is (x, y, 1).
/// Newton iteration; NaN where the distortion cannot be inverted.
[[nodiscard]] Eigen::Vector2d Undistort(const CameraModel& model, const Eigen::Vector2d& pixel);

}  // namespace fringe_fusion
