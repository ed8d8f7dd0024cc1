#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "fringe_fusion/calibration/detect_target.hpp"

namespace fringe_fusion::internal {

/// A dot or corner before its refinement.
struct Feature {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  /// Dots: d^T shape d = 1 on the rim, d from the centre.
  Eigen::Matrix2d shape = Eigen::Matrix2d::Identity();
  double radius_px = 0.0;  ///< dots: of the disc of equal area
  /// Corners: directions of the two edges, in [0, pi) [rad], rising; the sector between the first
  /// and the second is bright where `is_bright_between`.
  std::array<double, 2> edges_rad{};
  bool is_bright_between = false;
};

/// Dark discs on a lighter ground. @param picture dark dots; negate it for light ones.
[[nodiscard]] std::vector<Feature> FindDots(const Image<float>& picture,
                                            const DetectConfig& config);

/// Points where two edges cross and four sectors alternate.
[[nodiscard]] std::vector<Feature> FindCorners(const Image<float>& picture,
                                               const DetectConfig& config);

/// Bilinear grey value; the caller keeps a pixel of distance to the border.
[[nodiscard]] inline float SampleGrey(const Image<float>& picture, double x, double y) {
  const int left = static_cast<int>(x);
  const int top = static_cast<int>(y);
  const auto right = static_cast<float>(x - left);
  const auto below = static_cast<float>(y - top);
  const float upper = picture(left, top) + right * (picture(left + 1, top) - picture(left, top));
  const float lower =
      picture(left, top + 1) + right * (picture(left + 1, top + 1) - picture(left, top + 1));
  return upper + below * (lower - upper);
}

}  // namespace fringe_fusion::internal
