#pragma once

#include <string>
#include <vector>

#include "fringe_fusion/registration/pose_system.hpp"

namespace fringe_fusion {

/// Surfaces that slide in themselves.
enum class SlidingShape { kNone, kPlane, kSphere, kCylinder, kRevolution, kExtrusion, kOther };

/// Motions of one view that no partner of it resists.
struct WeakDirections {
  SlidingShape shape = SlidingShape::kNone;
  int count = 0;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< normal of the plane, or the axis
  Eigen::Vector3d point = Eigen::Vector3d::Zero();      ///< centre, or a point of the axis [m]
};

/// Information of the surface about one view against all others: twists of the object frame.
[[nodiscard]] Matrix6d SurfaceInformation(const std::vector<PairInformation>& pairs, int view);

/// Finds the directions with less than 1e-4 of the strongest information (1 % of the accuracy) and
/// what they have in common.
/// @param information of SurfaceInformation. @param middle, radius_m of the view, object frame.
/// Ref: Gelfand and Guibas, Shape segmentation using local slippage analysis, 2004, table 1.
[[nodiscard]] WeakDirections FindWeakDirections(const Matrix6d& information,
                                                const Eigen::Vector3d& middle, double radius_m);

/// In words, e.g. "sliding and turning in the plane with normal (0.00, 0.00, 1.00)"; empty: none.
[[nodiscard]] std::string Describe(const WeakDirections& weak);

}  // namespace fringe_fusion
