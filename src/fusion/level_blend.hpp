#pragma once

#include <array>

#include "block_field.hpp"

namespace fringe_fusion::internal {

/// Fills the cells of a block: how far each level differs from the next wider one.
void CompareLevels(int num_levels, BlockField& field);

/// A block and its neighbours, x fastest; the block itself is the middle one (13), absent ones are
/// nullptr.
using Neighborhood = std::array<const BlockField*, 27>;

struct BlendedField {
  std::array<float, kVoxelsPerBlock> distance{};  ///< [voxels]
  std::array<float, kVoxelsPerBlock> sigma{};     ///< [m]
};

/// The final field of a block: at each voxel the mix of the levels with the least expected squared
/// error. A wide kernel averages more noise away but bends edges and bumps. Where a level and the
/// next wider one differ by more than noise explains (variance V), the excess is taken for the bias
/// b of the wider one, and the finer one enters with the share b^2 / (b^2 + V). Both are means over
/// a neighbourhood, so that the share is smooth across blocks and does not follow the noise.
/// Ref: Lepski, On a problem of adaptive estimation in Gaussian white noise, 1991 (choice of width
/// by comparing estimates); James and Stein, Estimation with quadratic loss, 1961 (the share).
[[nodiscard]] BlendedField BlendLevels(const Neighborhood& blocks, int num_levels, double voxel_m);

}  // namespace fringe_fusion::internal
