#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/fusion/implicit_model.hpp"
#include "fringe_fusion/surface/extract_mesh.hpp"

namespace fringe_fusion {

/// A fusion whose model does not fit into memory.
struct SlabJob {
  FusionConfig fusion;  ///< max_memory_gb: of one slab; a view and its samples come on top
  CropConfig crop;
  SurfaceConfig surface;
  std::string mesh_path;       ///< .ply to write
  std::string scratch_folder;  ///< for about 80 B per voxel and view; empty: that of the system
  int max_columns = 0;         ///< of blocks in a slab; 0: as many as the memory holds
};

struct SlabFigures {
  int num_views = 0;  ///< with a point after cropping
  std::size_t num_points = 0;
  std::size_t num_blocks = 0;
  int num_slabs = 0;
  std::size_t num_vertices = 0;
  std::size_t num_faces = 0;
  std::uint64_t scratch_bytes = 0;  ///< of the samples
  double read_s = 0.0;              ///< views to samples
  double weigh_s = 0.0;             ///< how much the surface is measured at all
  double extract_s = 0.0;           ///< fields and mesh
};

/// @param index from 0 on; called once for each view, in this order.
using ViewReader = std::function<Result<View>(int index)>;

/// Views to a mesh file without ever holding more than one view and one slab of the model: the
/// views become samples in a scratch file, and slabs of blocks are fused and extracted one after
/// the other. The file has the bytes of WriteMesh(FuseViews(...).mesh).
/// Of what memory holds beside these, only the list of blocks (8 B each) and of pieces of the
/// surface grow with the scan.
/// @return error of reading, cropping, sampling, writing; when one column of blocks needs more than
/// the limit; when nothing is extracted; on cancel.
[[nodiscard]] Result<SlabFigures> FuseSlabs(const SlabJob& job, int num_views,
                                            const ViewReader& read,
                                            const Progress& progress = NoProgress);

}  // namespace fringe_fusion
