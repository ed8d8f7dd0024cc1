#include "coverage_grid.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace fringe_fusion {

void CoverageGrid::Add(const Eigen::Vector2d& pixel) {
  const double column = std::floor((pixel.x() + 0.5) * kColumns / width_);
  const double row = std::floor((pixel.y() + 0.5) * kRows / height_);
  if (!(column >= 0.0 && row >= 0.0 && column < kColumns && row < kRows)) return;
  filled_[static_cast<std::size_t>(row) * kColumns + static_cast<std::size_t>(column)] = true;
}

double CoverageGrid::Ratio() const {
  return static_cast<double>(std::count(filled_.begin(), filled_.end(), true)) /
         static_cast<double>(filled_.size());
}

std::string CoverageGrid::EmptyQuarters(const std::string& device) const {
  std::vector<std::string> quarters;
  for (const bool lower : {false, true}) {
    for (const bool right : {false, true}) {
      int empty = 0;
      for (int row = 0; row < kRows / 2; ++row) {
        for (int column = 0; column < kColumns / 2; ++column) {
          if (!Holds(column + (right ? kColumns / 2 : 0), row + (lower ? kRows / 2 : 0))) ++empty;
        }
      }
      if (2 * empty <= kRows * kColumns / 4) continue;
      quarters.push_back(fmt::format("{} {}", lower ? "lower" : "upper", right ? "right" : "left"));
    }
  }
  if (quarters.empty()) return {};
  if (quarters.size() == 4U) return fmt::format("the {} image is hardly covered", device);
  return fmt::format("the {} image is hardly covered in its {}", device, fmt::join(quarters, ", "));
}

}  // namespace fringe_fusion
