#pragma once

#include <string>
#include <vector>

#include "command.hpp"
#include "fringe_fusion/fusion/implicit_model.hpp"
#include "fringe_fusion/fusion/variational_surface.hpp"
#include "fringe_fusion/pose/view.hpp"
#include "fringe_fusion/surface/extract_mesh.hpp"

namespace fringe_fusion::cli {

/// Settings of the stages from posed views to the mesh of a variational surface.
struct VariationalStages {
  VariationalConfig variational;
  CropConfig crop;
  SurfaceConfig surface;
  bool voxel_is_given = false;  ///< false: the spacing of the points decides
};

/// @param voxel_m overrides the settings; 0: not given.
[[nodiscard]] Result<VariationalStages> LoadVariationalConfig(const Session& session,
                                                              double voxel_m);

struct VariationalMesh {
  VariationalSurface surface;
  Mesh mesh;
  int num_views = 0;
};

/// Crops views, fits the surface and extracts it; notes its figures in the session.
[[nodiscard]] Result<VariationalMesh> FuseVariational(const std::vector<View>& views,
                                                      const VariationalStages& config,
                                                      Session& session);

/// The main figures in words.
[[nodiscard]] std::string VariationalSummary(const VariationalMesh& fused);

}  // namespace fringe_fusion::cli
