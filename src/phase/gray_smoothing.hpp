#pragma once

#include <Eigen/Core>
#include <optional>

#include "fringe_fusion/common/image.hpp"

namespace fringe_fusion::decode {

/// A coordinate image with its standard deviations [projector px]; NaN where invalid.
struct CoordinateImage {
  Image<float> value_px;
  Image<float> sigma_px;
};

/// A plane fitted to the cell centres in a window about one pixel.
struct LocalPlane {
  double value_px = 0.0;        ///< at the centre pixel, relative to its cell centre
  Eigen::Vector2d slope_px_px;  ///< projector px per camera px
  double residual_px2 = 0.0;    ///< mean square residual
  double leverage = 0.0;        ///< variance of value_px for unit variance of a cell centre
  int count = 0;
};

/// @param max_step_px neighbours that differ more, per camera pixel, belong to another surface.
/// @return nothing where less than half of the window can be used.
[[nodiscard]] std::optional<LocalPlane> FitLocalPlane(const CoordinateImage& code, int x, int y,
                                                      int radius_px, float max_step_px);

/// Sub-cell coordinates of a Gray code: the value at the centre of a plane fitted to the cell
/// centres in a (2 radius + 1)^2 window. The rounding to cells acts like a dither, because the
/// window spans several cells; sigma is what the mean over the window leaves of the sawtooth of
/// rounding at the slope fitted to a window three times as wide, and what the residuals show beyond
/// it. Neighbouring results share samples: their errors are correlated over the window.
/// @param max_step_px neighbours that differ more, per camera pixel, belong to another surface.
[[nodiscard]] CoordinateImage SmoothGrayCode(const CoordinateImage& code, int radius_px,
                                             float max_step_px);

}  // namespace fringe_fusion::decode
