#pragma once

#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/fusion/implicit_model.hpp"
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
/// Vertices carry normal, colour, sigma and number of views. Same model, same bytes.
/// @return error when the model is empty or no cell is crossed by the surface, or on cancel.
/// Ref: Lorensen and Cline 1987; the table is the topologically consistent one of Montani 1994.
[[nodiscard]] Result<Mesh> ExtractMesh(const ImplicitModel& model, const SurfaceConfig& config,
                                       const Progress& progress = NoProgress);

}  // namespace fringe_fusion
