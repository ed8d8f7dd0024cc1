#pragma once

#include <cstddef>
#include <vector>

#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/fusion/voxel_field.hpp"
#include "fringe_fusion/pose/view.hpp"
#include "fringe_fusion/surface/extract_mesh.hpp"
#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion {

struct FillConfig {
  double max_hole_m = 0.02;  ///< larger holes stay open: the diagonal of the box around the rim
  bool watertight = false;   ///< close all holes, whatever their size
  /// Grid on which space is judged, over the voxel of the surface; coarser where the object is
  /// larger than max_cells of it.
  double grid_voxels = 2.0;
  int max_cells = 192;           ///< of the grid along the longest side of the object
  double clearance_cells = 1.5;  ///< lines of sight say "empty" up to here before the surface
  int sweeps = 60;               ///< of the solver on each level

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("max_hole_m", max_hole_m, 0.0, 100.0);
    field("watertight", watertight);
    field("grid_voxels", grid_voxels, 1.0, 32.0);
    field("max_cells", max_cells, 16, 512);
    field("clearance_cells", clearance_cells, 0.5, 10.0);
    field("sweeps", sweeps, 1, 10000);
  }
};

/// What filling did, for reports.
struct FillFigures {
  double grid_m = 0.0;
  std::size_t num_empty = 0;    ///< nodes of the grid that a line of sight passed
  std::size_t num_unknown = 0;  ///< nodes of which no sensor can tell
  int num_filled = 0;           ///< holes
  int num_left = 0;             ///< holes above the size limit
  std::size_t num_filled_faces = 0;
  std::size_t num_open_edges = 0;  ///< of the mesh; 0: watertight
};

struct FilledSurface {
  Mesh mesh;
  FillFigures figures;
};

/// Extracts the surface of a field and closes its holes through space of which no sensor can tell.
/// Space is seen (the field is supported), empty (a line of sight of a camera or projector passed)
/// or unknown. In the unknown the distance is continued harmonically on a grid, from coarse to
/// fine, with the seen distances fixed and with empty space positive by at least its depth; nothing
/// lies outside the box around the seen surface. The measured faces are those of ExtractMesh;
/// Mesh::filled_faces marks the others.
/// @param field the measured distance. @param views what was measured of the object.
/// @return error of the extraction, when a setting is out of bounds, or on cancel.
/// Ref: Curless and Levoy 1996 (empty, unseen, near the surface); Davis, Marschner, Garr and
/// Levoy, Filling holes in complex surfaces using volumetric diffusion, 2002.
[[nodiscard]] Result<FilledSurface> FillHoles(const VoxelField& field,
                                              const std::vector<const View*>& views,
                                              const FillConfig& config,
                                              const SurfaceConfig& surface,
                                              const Progress& progress = NoProgress);
[[nodiscard]] Result<FilledSurface> FillHoles(const VoxelField& field,
                                              const std::vector<View>& views,
                                              const FillConfig& config,
                                              const SurfaceConfig& surface,
                                              const Progress& progress = NoProgress);

}  // namespace fringe_fusion
