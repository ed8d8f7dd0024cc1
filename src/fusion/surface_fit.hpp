#pragma once

#include <Eigen/Core>

#include "kernel_sums.hpp"

namespace fringe_fusion::internal {

/// The surface that the sums at a point describe.
struct Surface {
  float distance = 0.0F;  ///< of the point to it, positive outside [voxels]
  Eigen::Vector3f gradient = Eigen::Vector3f::Zero();
};

/// The sums at one point [voxels].
struct PointSums {
  double weight = 0.0;
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  ///< S1
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< S2
  double offset_normal = 0.0;                        ///< S3
  double offset_squared = 0.0;                       ///< S4
};

/// Order 0, the generalised implicit equation: D = -S3 / W.
[[nodiscard]] Surface PlaneSurface(const PointSums& sums);

/// Order 2: distance to the algebraic sphere u0 + u.x + u4 |x|^2 fitted to the sums; order 0 where
/// the fit is not a surface near the point.
/// Ref: Guennebaud and Gross, Algebraic Point Set Surfaces, 2007.
[[nodiscard]] Surface SphereSurface(const PointSums& sums);

/// Distance of the samples' centroid from the point, along the surface only [voxels]: a point off
/// the surface has its centroid that far along the normal.
[[nodiscard]] double CentroidOffset(const PointSums& sums);

[[nodiscard]] PointSums SumsAt(const KernelSums& sums, int voxel);

}  // namespace fringe_fusion::internal
