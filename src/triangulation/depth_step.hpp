#pragma once

#include <cmath>

#include "fringe_fusion/triangulation/range_image.hpp"

namespace fringe_fusion::triangulation {

/// Tells whether two measured points of an organised cloud can lie on one surface: their step
/// along the line of sight against their distance across it, with 3 sigma of noise on both.
class DepthStep {
 public:
  DepthStep(const RangeImage& range, const TriangulationConfig& config)
      : range_(range), ratio_(static_cast<float>(config.max_depth_step_ratio)) {}

  /// @param to_camera unit direction from the first point towards the camera.
  [[nodiscard]] bool Connects(int x0, int y0, int x1, int y1,
                              const Eigen::Vector3f& to_camera) const {
    const Eigen::Vector3f step = range_.points(x1, y1) - range_.points(x0, y0);
    const float along = step.dot(to_camera);
    const float across = (step - along * to_camera).norm();
    const float noise = std::hypot(range_.sigma_range(x0, y0), range_.sigma_range(x1, y1));
    const float allowance = std::isfinite(noise) ? 3.0F * noise : 0.0F;
    return std::abs(along) <= ratio_ * across + allowance;  // NaN never connects.
  }

 private:
  const RangeImage& range_;
  float ratio_;
};

}  // namespace fringe_fusion::triangulation
