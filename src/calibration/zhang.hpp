#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "fringe_fusion/geometry/camera_model.hpp"
#include "fringe_fusion/geometry/transform.hpp"

namespace fringe_fusion::bundle {

/// A flat target and where one device saw its points.
struct PlanarView {
  std::vector<Eigen::Vector2d> plane_m;
  std::vector<Eigen::Vector2d> pixel;
};

struct PlanarHomography {
  Eigen::Matrix3d H = Eigen::Matrix3d::Identity();  ///< pixel ~ H (x, y, 1), unit norm
  double median_residual_px = 0.0;
  bool mirrored = false;  ///< the target is seen from behind
};

/// Homography by normalised DLT with Cauchy weights, so that single bad points do not matter.
/// @return nothing for fewer than four points or points on a line.
/// Ref: Hartley & Zisserman, Multiple View Geometry, 2nd ed., alg. 4.2.
[[nodiscard]] std::optional<PlanarHomography> FitHomography(const PlanarView& view);

/// Intrinsics without skew and distortion from homographies of several planes.
/// @param principal known principal point; none: it is solved for.
/// @return nothing when the planes do not determine them.
/// Ref: Zhang, PAMI 22(11), 2000, section 3.1.
[[nodiscard]] std::optional<CameraModel> ZhangIntrinsics(
    const std::vector<Eigen::Matrix3d>& homographies, int width, int height,
    const std::optional<Eigen::Vector2d>& principal);

/// T_device_target of a plane with z > 0.
[[nodiscard]] Transform PlanePose(const Eigen::Matrix3d& H, const CameraModel& model);

}  // namespace fringe_fusion::bundle
