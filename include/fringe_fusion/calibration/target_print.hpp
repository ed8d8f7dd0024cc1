#pragma once

#include <Eigen/Core>
#include <vector>

#include "fringe_fusion/calibration/target.hpp"

namespace fringe_fusion {

/// A disc or an upright rectangle of one grey. Shapes are disjoint, or lie wholly on one before
/// them in the list.
struct PrintShape {
  bool is_disc = false;
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();     ///< target frame
  Eigen::Vector2d half_size_m = Eigen::Vector2d::Zero();  ///< of a disc: its radius, twice
  double lightness = 0.0;                                 ///< 0: black, 1: white
  double lightness_below = 1.0;                           ///< of what it lies on
};

/// What is on the plate of a target, in the target frame.
struct TargetPrint {
  double ground_lightness = 1.0;
  Eigen::Vector2d min_m = Eigen::Vector2d::Zero();  ///< of the ground that must stay free
  Eigen::Vector2d max_m = Eigen::Vector2d::Zero();
  std::vector<PrintShape> shapes;
};

/// The print of a target. Chessboards are black in the corner before point 0; ChArUco markers are
/// numbered row after row in the white squares (OpenCV 4.7's layout; 4.6's for an odd number of
/// rows of squares). Ring dots lie in white rings on a ground of their own grey.
/// @param target valid.
[[nodiscard]] TargetPrint MakeTargetPrint(const CalibrationTarget& target);

/// Middle of each ChArUco marker in the target frame [m], by its number; empty for other kinds.
[[nodiscard]] std::vector<Eigen::Vector2d> CharucoMarkerCentres(const CalibrationTarget& target);

}  // namespace fringe_fusion
