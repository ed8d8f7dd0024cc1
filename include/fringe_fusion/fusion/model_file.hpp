#pragma once

#include <cstdint>
#include <string>

#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/fusion/implicit_model.hpp"

namespace fringe_fusion {

/// Which scan a model belongs to, so that work on it can go on.
struct ModelOrigin {
  std::string scan_id;              ///< empty: not of a live scan
  std::uint32_t pose_revision = 0;  ///< solution of the poses that its views have
};

/// Writes a model as an OpenVDB file. Any reader of .vdb finds the grids `distance` [m] and `sigma`
/// [m] over the supported voxels, in metres of `object`. The settings and the samples of each view
/// travel in the file's metadata, so that a model that was read back takes and gives views as
/// before. The file appears whole or not at all.
/// @return error naming the path and the cause, e.g. "No space left on device".
[[nodiscard]] Status SaveModel(const ImplicitModel& model, const std::string& path,
                               const ModelOrigin& origin = {});

struct SavedModel {
  ImplicitModel model;
  ModelOrigin origin;
};

/// Reads a model that SaveModel wrote; the same bytes in every voxel.
/// @return error naming the path when the file is missing, cut off, of another kind, or damaged.
[[nodiscard]] Result<SavedModel> LoadModel(const std::string& path,
                                           const Progress& progress = NoProgress);

}  // namespace fringe_fusion
