#pragma once

#include <Eigen/Core>
#include <optional>

#include "fringe_fusion/calibration/target.hpp"

namespace fringe_fusion::internal {

/// Maps the plane of a target to pixels.
struct Homography {
  Eigen::Matrix3d H = Eigen::Matrix3d::Identity();

  [[nodiscard]] Eigen::Vector2d Map(const Eigen::Vector2d& point) const;
  /// Derivative of the pixel by the point [px/m].
  [[nodiscard]] Eigen::Matrix2d Jacobian(const Eigen::Vector2d& point) const;
};

/// Least squares over all points of a sighting. @return nothing when they do not fix it.
/// Ref: Hartley & Zisserman, Multiple View Geometry, 2003, algorithm 4.2 (normalised DLT).
[[nodiscard]] std::optional<Homography> FitTargetHomography(const TargetSighting& sighting,
                                                            const CalibrationTarget& target);

/// Centre of the ellipse that a disc becomes: H Q^-1 H^T e3 with the disc's dual conic Q^-1.
/// Ref: science section 1.2.
[[nodiscard]] Eigen::Vector2d EllipseCentre(const Homography& homography,
                                            const Eigen::Vector2d& point, double radius_m);

}  // namespace fringe_fusion::internal
