#pragma once

#include <vector>

#include "command.hpp"
#include "fringe_fusion/fusion/implicit_model.hpp"
#include "fringe_fusion/pose/view.hpp"
#include "fringe_fusion/surface/extract_mesh.hpp"

namespace fringe_fusion::cli {

/// Settings of the stages from posed views to a mesh.
struct FuseConfig {
  FusionConfig fusion;
  CropConfig crop;
  SurfaceConfig surface;
  bool voxel_is_given = false;  ///< false: the spacing of the points decides
};

/// @param voxel_m overrides the settings; 0: not given.
[[nodiscard]] Result<FuseConfig> LoadFuseConfig(const Session& session, double voxel_m);

/// Crops and fuses views and extracts the surface; notes its figures in the session.
[[nodiscard]] Result<Mesh> FuseToMesh(const std::vector<View>& views, const FuseConfig& config,
                                      Session& session);

}  // namespace fringe_fusion::cli
