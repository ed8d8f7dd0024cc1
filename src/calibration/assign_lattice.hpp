#pragma once

#include <vector>

#include "charuco_marker.hpp"
#include "lattice.hpp"

namespace fringe_fusion::internal {

/// Which point of the target each node of a lattice is.
struct Assignment {
  std::vector<int> points;  ///< per node of the lattice, -1: none
  bool is_orientation_assumed = false;
};

/// Lays the target over a lattice: every turn (and, to recognise a mirrored print, every mirrored
/// turn) and shift, judged by the places that agree, by marked dots, markers and dark squares.
/// @param markers those found, for ChArUco.
/// @return error that tells what the lattice shows instead, as DetectTarget.
[[nodiscard]] Result<Assignment> AssignLattice(const Lattice& lattice,
                                               const std::vector<Feature>& features,
                                               const CalibrationTarget& target,
                                               const std::vector<FoundMarker>& markers,
                                               const DetectConfig& config);

}  // namespace fringe_fusion::internal
