#pragma once

#include <optional>
#include <vector>

namespace fringe_fusion {

/// Two layers in the residuals of a pair of views.
struct DoubledSurface {
  double distance_m = 0.0;  ///< between the layers
  double share = 0.0;       ///< of the residuals in the smaller layer
};

/// Whether residuals are bimodal: two normal distributions fit them better than one, each holds a
/// tenth of them, and they lie three of their standard deviations apart.
/// @param residuals_m signed; fewer than 100 are never called doubled.
/// @param sigma_m stated standard deviation of a residual; layers nearer than three are one. 0:
/// unknown.
/// Ref: Ashman, Bird, Zepf, Detecting bimodality in astronomical datasets, 1994, eq. 4 (D > 2).
[[nodiscard]] std::optional<DoubledSurface> FindDoubledSurface(
    const std::vector<float>& residuals_m, double sigma_m);

}  // namespace fringe_fusion
