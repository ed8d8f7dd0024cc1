#pragma once

#include <Eigen/Core>
#include <optional>

#include "feature.hpp"

namespace fringe_fusion::internal {

/// A point after the fit of the blurred print to the grey values.
struct RefinedPoint {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Zero();
  Eigen::Matrix2d shape = Eigen::Matrix2d::Zero();  ///< dots: of the rim, as Feature::shape
  double blur_px = 0.0;                             ///< sigma of the edges
  double contrast_dn = 0.0;
  double residual_dn = 0.0;  ///< rms
};

/// Fits a dark ellipse on a lighter ground, its edge blurred, under light that changes linearly.
/// @param reach_px how far outside the rim the ground may be used.
/// @return nothing where the window leaves the picture or the fit fails or strays.
[[nodiscard]] std::optional<RefinedPoint> RefineDot(const Image<float>& picture, const Feature& dot,
                                                    double reach_px, const DetectConfig& config);

/// Fits two crossing edges, four sectors alternating.
/// @param radius_px of the window about the corner.
[[nodiscard]] std::optional<RefinedPoint> RefineCorner(const Image<float>& picture,
                                                       const Feature& corner, double radius_px,
                                                       const DetectConfig& config);

}  // namespace fringe_fusion::internal
