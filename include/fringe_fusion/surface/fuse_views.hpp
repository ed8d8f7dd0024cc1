#pragma once

#include <cstddef>
#include <vector>

#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/fusion/implicit_model.hpp"
#include "fringe_fusion/fusion/view_agreement.hpp"
#include "fringe_fusion/surface/extract_mesh.hpp"

namespace fringe_fusion {

/// What a fusion did, for reports.
struct FusionFigures {
  int num_views = 0;
  int num_points = 0;  ///< that went into the fusion
  int num_outside_box = 0;
  int num_on_plane = 0;
  int num_on_fixture = 0;
  int num_empty_views = 0;  ///< left out because no point remained after cropping
  std::size_t num_blocks = 0;
  std::size_t memory_bytes = 0;
  std::vector<ViewAgreement> views;  ///< how well each view agrees with the others
  double integrate_s = 0.0;
  double extract_s = 0.0;
};

struct FusedSurface {
  ImplicitModel model;
  Mesh mesh;
  FusionFigures figures;
};

/// Views to surface in one call: crop, integrate, compare the views, extract.
/// @return error of any of the stages, e.g. when no point remains after cropping.
[[nodiscard]] Result<FusedSurface> FuseViews(const std::vector<View>& views,
                                             const FusionConfig& fusion, const CropConfig& crop,
                                             const SurfaceConfig& surface,
                                             const Progress& progress = NoProgress);

}  // namespace fringe_fusion
