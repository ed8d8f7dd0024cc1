#pragma once

#include <Eigen/Core>
#include <vector>

#include "epipolar_solver.hpp"

namespace fringe_fusion::epipolar {

/// Weighted eight-point fundamental matrix of normalised coordinates, of rank two, reweighted
/// three times with the one-sided variance.
/// @param start matrix that separates inliers and gives the first weights.
/// Ref: Hartley, "In defense of the eight-point algorithm", PAMI 19(6), 1997.
[[nodiscard]] Eigen::Matrix3d EightPoint(const std::vector<Ray>& rays,
                                         const Eigen::Matrix3d& start);

}  // namespace fringe_fusion::epipolar
