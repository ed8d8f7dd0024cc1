#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "fringe_fusion/diagnosis/response.hpp"

namespace fringe_fusion::diagnosis {

/// Light in a cosine pattern of full swing at phase theta.
[[nodiscard]] inline double CosineLight(double theta_rad) {
  return 0.5 + 0.5 * std::cos(theta_rad);
}

/// Light that is seen where a light of 0..1 was wanted: between the values interpolated.
[[nodiscard]] inline double SeenLight(const ResponseCurve& response, double light) {
  const double value = 255.0 * std::clamp(light, 0.0, 1.0);
  const auto low = std::min(static_cast<std::size_t>(value), std::size_t{254});
  const double part = value - static_cast<double>(low);
  return response.light[low] + part * (response.light[low + 1] - response.light[low]);
}

}  // namespace fringe_fusion::diagnosis
