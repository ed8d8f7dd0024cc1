#pragma once

#include <vector>

#include "fringe_fusion/triangulation/range_image.hpp"

namespace fringe_fusion {

/// Median distance between points of neighbouring pixels (right and below), over all images: the
/// resolution at which a surface was sampled.
/// @param ranges none of them null.
/// @return [m], NaN if no two neighbours are valid.
[[nodiscard]] double MedianPointSpacing(const std::vector<const RangeImage*>& ranges);

}  // namespace fringe_fusion
