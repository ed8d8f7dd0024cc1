#pragma once

#include <Eigen/Core>
#include <vector>

#include "surface_fit.hpp"
#include "view_samples.hpp"

namespace fringe_fusion::internal {

/// What a set of views says at one point, without a grid.
struct PointField {
  PointSums sums;
  double variance = 0.0;       ///< sum w^2 sigma^2 over the points' own noise
  std::vector<int> view_ids;   ///< of the views with weight there, ascending
  double pose_variance = 0.0;  ///< of the weighted mean, by what whole views share [m^2]
};

/// Sums of level 0 at a point.
/// @param position [voxels] in `object`.
/// @param normal unit normal of the sheet that is meant; zero: all sheets.
[[nodiscard]] PointField SumAtPoint(const Eigen::Vector3d& position, const Eigen::Vector3f& normal,
                                    const std::vector<const ViewSamples*>& views, double voxel_m);

}  // namespace fringe_fusion::internal
