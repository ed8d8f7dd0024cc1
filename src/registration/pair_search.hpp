#pragma once

#include <vector>

#include "coarse_features.hpp"
#include "fringe_fusion/registration/assemble_views.hpp"
#include "fringe_fusion/registration/match_views.hpp"

namespace fringe_fusion::internal {

/// A way in which two views may fit.
struct Hypothesis {
  int first = 0;
  int second = 0;
  Transform T_first_second = Transform::Identity();
  PairCheck check;
};

/// Ways in which two views may fit, the best first, refined and with different poses.
/// @param distance_m of points in agreement.
[[nodiscard]] std::vector<Hypothesis> SearchPair(const SurfaceSet& set,
                                                 const std::vector<FeatureCloud>& clouds,
                                                 const PairNumbers& pair,
                                                 const AssemblyConfig& config, double cell_m);

/// Distance of points in agreement after a first refinement, for a cell size [m].
[[nodiscard]] double AgreementDistance(const SurfaceSet& set, double cell_m);

}  // namespace fringe_fusion::internal
