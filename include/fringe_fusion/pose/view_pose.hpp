#pragma once

#include <vector>

#include "fringe_fusion/geometry/camera_model.hpp"
#include "fringe_fusion/geometry/transform.hpp"
#include "fringe_fusion/pose/epipolar_config.hpp"
#include "fringe_fusion/pose/match.hpp"
#include "fringe_fusion/triangulation/range_image.hpp"

namespace fringe_fusion {

/// A point that the moving rig has triangulated, and where a projector at rest lights it.
struct LitPoint {
  Eigen::Vector3d point_rig = Eigen::Vector3d::Zero();           ///< [m]
  Eigen::Matrix3d covariance_m2 = Eigen::Matrix3d::Zero();       ///< of the point
  Eigen::Vector2d projector_px = Eigen::Vector2d::Zero();        ///< decoded
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();  ///< of the code
};

/// Points of a range image at the camera pixels of matches with a projector at rest.
/// @param matches anchor = camera that took `range`, observed = projector at rest. Matches outside
/// the image or without a point are left out.
[[nodiscard]] std::vector<LitPoint> MakeLitPoints(const RangeImage& range,
                                                  const std::vector<Match>& matches);

/// Pose of the rig against the projector at rest, metric.
struct RigPose {
  Transform T_projector_rig = Transform::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< of the right perturbation T Exp(xi)
  int num_points = 0;
  int num_inliers = 0;
  double rms_px = 0.0;        ///< of the inliers, per coordinate
  double reduced_chi2 = 0.0;  ///< of the inliers
};

/// Where a moving rig stands against one projector at rest: all views get poses in one frame.
/// Minimises the projector residual with Sigma = Sigma_p + J Sigma_X J^T; Huber weights, at last
/// without the points beyond four deviations. Start: EPnP with RANSAC.
/// @return error for too few points, values that are not finite, no start, too few inliers, or a
/// singular system.
/// Ref: Lepetit et al., "EPnP", IJCV 81, 2009; science 3.6.
[[nodiscard]] Result<RigPose> EstimateViewPose(const std::vector<LitPoint>& points,
                                               const CameraModel& projector,
                                               const EpipolarConfig& config);

}  // namespace fringe_fusion
