#pragma once

#include "fringe_fusion/common/image.hpp"

namespace fringe_fusion::diagnosis {

struct EdgeBlur {
  double sigma_px = 0.0;  ///< of the sharper edges, as a Gaussian with the pixel's own area in it
  int num_edges = 0;
};

/// Blur of the camera from the steps of brightness at outlines, texture and shadows: a Gaussian
/// edge of height h has a slope of at most h / (sqrt(2 pi) sigma). Edges of the part are never
/// sharper than the lens, but may be softer: the sharper ones count.
/// @param mean image without fringes, at full resolution.
[[nodiscard]] EdgeBlur MeasureEdgeBlur(const Image<float>& mean);

}  // namespace fringe_fusion::diagnosis
