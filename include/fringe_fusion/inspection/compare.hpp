#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion {

struct InspectionConfig {
  double max_distance_m = 0.005;        ///< farther points count as not covered / stray
  double complete_distance_m = 0.0005;  ///< a reference sample this close to the model is covered
  double sample_spacing_m = 0.0005;     ///< of the samples on the reference
  bool ignore_filled = true;            ///< leave out faces that close holes

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("max_distance_m", max_distance_m, 1e-7, 100.0);
    field("complete_distance_m", complete_distance_m, 1e-7, 100.0);
    field("sample_spacing_m", sample_spacing_m, 1e-7, 100.0);
    field("ignore_filled", ignore_filled);
  }
};

/// Statistics of signed or unsigned distances [m].
struct DistanceStatistics {
  std::size_t count = 0;    ///< samples within max_distance_m
  std::size_t num_far = 0;  ///< samples beyond it
  double mean_m = 0.0;      ///< signed mean
  double rms_m = 0.0;
  double median_abs_m = 0.0;
  double p95_abs_m = 0.0;
  double max_abs_m = 0.0;
};

struct InspectionResult {
  DistanceStatistics model_to_reference;  ///< signed: positive outside the reference
  DistanceStatistics reference_to_model;  ///< unsigned unless the model is a mesh with faces
  double completeness_ratio = 0.0;        ///< share of the (visible) reference area that is covered
  std::vector<float> deviation_m;         ///< per model vertex, signed; NaN where far
};

/// Signed deviation of a mesh or cloud (no faces) from a reference mesh, both ways. Nothing is
/// aligned: both must be in the same frame.
/// @param reference_visible optional flag per reference face; the reference is sampled only there.
/// @return error for an empty model, a reference without faces, non-finite vertices, or when no
/// sample of one is within max_distance_m of the other.
[[nodiscard]] Result<InspectionResult> Compare(
    const Mesh& model, const Mesh& reference, const InspectionConfig& config,
    const std::optional<std::vector<std::uint8_t>>& reference_visible = std::nullopt,
    const Progress& progress = NoProgress);

}  // namespace fringe_fusion
