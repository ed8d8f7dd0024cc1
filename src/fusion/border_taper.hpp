#pragma once

#include "fringe_fusion/common/image.hpp"
#include "fringe_fusion/triangulation/range_image.hpp"

namespace fringe_fusion::internal {

/// Factor 0..1 per pixel that fades smoothly towards the border of the valid pixels and towards
/// depth steps, so that the field stays continuous where a view begins or ends.
/// Zero for spikes: points that fewer than two of their eight neighbours confirm.
/// @param taper_px width of the fade; 0: no fade.
/// @param step_m neighbours farther than this off each other's tangent plane are a depth step.
[[nodiscard]] Image<float> BorderTaper(const RangeImage& range, double taper_px, double step_m);

/// Median distance of neighbouring valid points, the larger of the two image directions [m].
/// 0 for clouds without image structure (one row or column) or without neighbours.
[[nodiscard]] double PointSpacing(const RangeImage& range);

}  // namespace fringe_fusion::internal
