#pragma once

#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/fusion/voxel_field.hpp"
#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion {

struct SurfaceConfig {
  int min_component_faces = 100;  ///< smaller connected pieces are removed

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("min_component_faces", min_component_faces, 0, 1000000000);
  }
};

/// Marching cubes over the supported voxels; the boundary stays open where nothing was measured.
/// No edge has more than two faces, no two vertices share an edge of the grid, and where all is
/// supported the mesh is closed. Vertices lie at the root of the cubic through the four voxels
/// around them and carry normal, colour, sigma and number of views. Same model, same bytes.
/// @return error when the model is empty or no cell is crossed by the surface, or on cancel.
/// Ref: Lorensen and Cline, Marching Cubes, 1987; the ambiguous faces are resolved by one rule for
/// all, as in Montani, Scateni and Scopigno, A modified look-up table for implicit disambiguation
/// of Marching Cubes, 1994.
[[nodiscard]] Result<Mesh> ExtractMesh(const VoxelField& model, const SurfaceConfig& config,
                                       const Progress& progress = NoProgress);

}  // namespace fringe_fusion
