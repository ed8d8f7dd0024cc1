#pragma once

namespace fringe_fusion::internal {

/// Variance of the distance over that with exact normals, when the samples' normals come from plane
/// fits to the same noisy points. On a flat part the sums read the height
///   sum w (delta - c x . g) / sum w,   g: slope of the fit about the sample,
/// with c = 1 at order 0 and c = 1/2 at order 2, which is one linear kernel on the noise delta;
/// this is its squared norm over that of w.
/// @param window half width of the fit over the kernel's h; 0: the normals are exact (1).
[[nodiscard]] double NormalNoiseFactor(double window, int order);

}  // namespace fringe_fusion::internal
