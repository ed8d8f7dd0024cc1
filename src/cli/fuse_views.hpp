#pragma once

#include <string>
#include <vector>

#include "command.hpp"
#include "fringe_fusion/fusion/implicit_model.hpp"
#include "fringe_fusion/inspection/report.hpp"
#include "fringe_fusion/pose/view.hpp"
#include "fringe_fusion/surface/extract_mesh.hpp"
#include "fringe_fusion/surface/fuse_views.hpp"

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

/// A mesh and how it came about.
struct FusedMesh {
  ImplicitModel model;
  Mesh mesh;
  FusionFigures figures;
  double voxel_m = 0.0;
};

/// Crops and fuses views and extracts the surface; notes its figures in the session.
[[nodiscard]] Result<FusedMesh> FuseToMesh(const std::vector<View>& views, const FuseConfig& config,
                                           Session& session);

/// The main figures in words, e.g. "12 views, 345678 points, 10000 vertices, ...".
[[nodiscard]] std::string FusionSummary(const FusedMesh& fused);
/// How many points went into the fusion, and how many were left out, by reason.
[[nodiscard]] Report::Table PointTable(const FusionFigures& figures);

}  // namespace fringe_fusion::cli
