#pragma once

#include <vector>

#include "fringe_fusion/fusion/variational_surface.hpp"
#include "variational_fit.hpp"

namespace fringe_fusion::internal {

struct ChosenWidth {
  double width_m = 0.0;
  double score = 0.0;  ///< mean square of the left-out points' distances over sigma^2
};

/// The smoothing width with which the surface meets points best that took no part in the fit: at
/// some places one point in `folds` is left out; the score is the mean of (D / sigma)^2 of these,
/// with the distance D = f / |grad f|: f alone shrinks where its gradient does.
/// @param settings everything but the width.
[[nodiscard]] ChosenWidth ChooseSmoothing(const std::vector<MeasuredPoint>& points,
                                          double spacing_m, const VariationalConfig& config,
                                          FitSettings settings);

}  // namespace fringe_fusion::internal
