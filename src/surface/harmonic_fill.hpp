#pragma once

#include <cstdint>
#include <vector>

#include "space_grid.hpp"

namespace fringe_fusion::internal {

/// Values on a grid: fixed, or free with a lower bound.
struct FillProblem {
  SpaceGrid grid;
  std::vector<float> value;         ///< where fixed; else ignored
  std::vector<std::uint8_t> fixed;  ///< 1: the value stays
  std::vector<float> lower;         ///< of the free values; -infinity: none
};

/// The harmonic function with these values: the mean of its neighbours wherever the bound allows
/// it, mirrored at the border of the grid. Solved on a coarse grid first, whose result starts the
/// next finer one (cascadic multigrid, projected successive over-relaxation in two colours). The
/// same on any number of threads.
/// Ref: Bornemann and Deuflhard, The cascadic multigrid method for elliptic problems, 1996.
[[nodiscard]] std::vector<float> SolveHarmonic(const FillProblem& problem, int sweeps);

}  // namespace fringe_fusion::internal
