#pragma once

#include <Eigen/Core>

#include "fringe_fusion/calibration/cell_calibration.hpp"

namespace fringe_fusion::triangulation {

/// Projector coordinates of one camera pixel; NaN coordinate: not measured.
struct Observation {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< (u, v) [projector px]
  Eigen::Vector2d sigma = Eigen::Vector2d::Ones();  ///< [projector px]
};

/// Where the surface cuts one camera ray.
struct RayPoint {
  bool converged = false;
  double depth_m = 0.0;        ///< lambda of the point lambda (x, y, 1)
  double sigma_depth_m = 0.0;  ///< standard deviation of lambda
  double epipolar_px = 0.0;    ///< signed distance to the epipolar line, NaN with one coordinate
  double sigma_epipolar_px = 0.0;
};

/// Weighted least squares of the depth along a camera ray; science section 2.5:
/// lambda minimises ((u - u(lambda)) / sigma_u)^2 + ((v - v(lambda)) / sigma_v)^2.
class RaySolver {
 public:
  explicit RaySolver(const CellCalibration& calibration);

  /// @param ray (x, y): the camera ray is (x, y, 1).
  [[nodiscard]] RayPoint Solve(const Eigen::Vector2d& ray, const Observation& observation) const;

 private:
  [[nodiscard]] double ClosedForm(const Eigen::Vector3d& ray_projector,
                                  const Eigen::Vector2d& pixel,
                                  const Eigen::Vector2d& weight) const;

  CameraModel projector_;
  Eigen::Matrix3d R_projector_camera_;
  Eigen::Vector3d t_projector_camera_;
};

}  // namespace fringe_fusion::triangulation
