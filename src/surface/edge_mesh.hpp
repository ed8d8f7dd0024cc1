#pragma once

#include <cstdint>
#include <vector>

#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/fusion/voxel_field.hpp"
#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion::internal {

/// A grid edge: its lower voxel and its axis, 20 bits for a coordinate and 2 for the axis. Numeric
/// order is the lexicographic order of the voxels.
using EdgeKey = std::uint64_t;

/// x of the lower voxel of an edge.
[[nodiscard]] int VoxelColumn(EdgeKey edge);

/// A mesh with the edge on which each vertex lies, ascending.
struct EdgeMesh {
  std::vector<EdgeKey> edges;
  Mesh mesh;
};

/// What ExtractMesh makes before it removes small pieces; no faces where nothing is crossed.
[[nodiscard]] Result<EdgeMesh> ExtractEdgeMesh(const VoxelField& field, const Progress& progress);

}  // namespace fringe_fusion::internal
