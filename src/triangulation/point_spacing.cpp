#include "fringe_fusion/triangulation/point_spacing.hpp"

#include <algorithm>
#include <limits>

namespace fringe_fusion {

double MedianPointSpacing(const std::vector<const RangeImage*>& ranges) {
  std::vector<float> spacings;
  for (const RangeImage* range : ranges) {
    for (int y = 0; y < range->height; ++y) {
      for (int x = 0; x < range->width; ++x) {
        if (!IsValid(*range, x, y)) continue;
        const Eigen::Vector3f& point = range->points(x, y);
        if (x + 1 < range->width && IsValid(*range, x + 1, y)) {
          spacings.push_back((range->points(x + 1, y) - point).norm());
        }
        if (y + 1 < range->height && IsValid(*range, x, y + 1)) {
          spacings.push_back((range->points(x, y + 1) - point).norm());
        }
      }
    }
  }
  if (spacings.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = spacings.begin() + static_cast<std::ptrdiff_t>(spacings.size() / 2);
  std::nth_element(spacings.begin(), middle, spacings.end());
  return static_cast<double>(*middle);
}

}  // namespace fringe_fusion
