#pragma once

#include <Eigen/Core>
#include <vector>

#include "fringe_fusion/pose/view.hpp"

namespace fringe_fusion::bench {

/// The pixels of all views of a scene: square, without distortion.
struct PinholeGrid {
  double focal_px = 0.0;
  Eigen::Vector2d middle_px = Eigen::Vector2d::Zero();  ///< where the optical axis meets the image
};

/// Most that noisy views of an unknown smooth surface can say about where they were taken.
///
/// Every patch of the surface has one unknown, its offset along the normal. View k measures it with
/// the weight a_k per area, the density of its pixels over the variance along the normal, and a
/// motion of it moves the patch by J_k. Without the offset,
///   sum_k a_k J_k^T J_k - (sum_k a_k J_k)^T (sum_k a_k J_k) / sum_k a_k
/// remains of each patch. What a view sees follows from the exact images: a patch counts where the
/// pixel that it falls on shows a point in its tangent plane.
/// @param exact views without noise, at their true poses. Only points and normals are read.
/// @param sigma_m noise along the ray, of every pixel.
/// @return 6 n x 6 n, right perturbations of all views; singular by the six of the object frame.
[[nodiscard]] Eigen::MatrixXd RegistrationInformation(const std::vector<View>& exact,
                                                      const PinholeGrid& grid, double sigma_m);

/// How far poses that reach the bound are off: median
/// over draws of the largest rms over the points of a view, after one rigid alignment of all.
/// @param information of RegistrationInformation.
[[nodiscard]] double ExpectedMaxRms(const std::vector<View>& exact,
                                    const Eigen::MatrixXd& information, int num_draws);

}  // namespace fringe_fusion::bench
