#pragma once

#include <vector>

#include "fringe_fusion/triangulation/range_image.hpp"

namespace fringe_fusion {

/// Share of the pixels around a valid pixel that are valid too, the median over the image: 1 for a
/// dense one, about a quarter where one camera pixel in four carries a point (Gray code alone).
/// @return NaN if no pixel is valid.
[[nodiscard]] double FillRatio(const RangeImage& range);

/// Median distance between points of neighbouring pixels (right and below), over all images, over
/// the root of the fill ratio: the resolution at which a surface was sampled.
/// @param ranges none of them null.
/// @return [m], NaN if no two neighbours are valid.
[[nodiscard]] double MedianPointSpacing(const std::vector<const RangeImage*>& ranges);

}  // namespace fringe_fusion
