#pragma once

#include <Eigen/Core>

#include "fringe_fusion/geometry/camera_model.hpp"

namespace fringe_fusion::bundle {

/// How far the lens moves the middle of an imaged dot beyond the pixel of its undistorted ellipse's
/// centre [px]: the bend of the distortion within the dot, to second order in its size.
/// @param point_camera middle of the dot. @param R_camera_target its plane: x and y.
///
/// With the map P from normalised coordinates to pixels and M the second moments of the ellipse,
/// the centroid of P(ellipse) is P(centre) + 1/2 sum M_ij d_i d_j P + J_P M grad ln |J_P|.
[[nodiscard]] Eigen::Vector2d LensShiftOfDot(const CameraModel& model,
                                             const Eigen::Vector3d& point_camera,
                                             const Eigen::Matrix3d& R_camera_target,
                                             double radius_m);

}  // namespace fringe_fusion::bundle
