#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "block_key.hpp"
#include "variational_cells.hpp"

namespace fringe_fusion::internal {

/// A voxel of the band around the surface.
struct BandVoxel {
  float distance = 0.0F;                   ///< D [m]
  std::array<std::int16_t, 3> gradient{};  ///< unit vector times kBandScale
  std::int32_t center = -1;                ///< nearest one; -1: not supported
};
constexpr float kBandScale = 32767.0F;

struct BandBlock {
  BlockKey key = 0;
  std::vector<BandVoxel> voxels;  // kVoxelsPerBlock, x fastest
};

struct BandSettings {
  double voxel_m = 0.001;
  double reach_m = 0.0;  ///< of a centre along the surface
};

/// Blocks that may hold supported voxels, ascending.
[[nodiscard]] std::vector<BlockKey> BandBlocks(const std::vector<Center>& centers,
                                               const BandSettings& settings);

/// Evaluates the cells on the voxels near the centres. Blocks without one are left out.
[[nodiscard]] std::vector<BandBlock> EvaluateBand(const std::vector<Center>& centers,
                                                  const CellTree& cells,
                                                  const std::vector<BlockKey>& blocks,
                                                  const BandSettings& settings);

}  // namespace fringe_fusion::internal
