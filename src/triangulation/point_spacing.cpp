#include "fringe_fusion/triangulation/point_spacing.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fringe_fusion {
namespace {

constexpr int kMaxStepPx = 4;     // to the next valid pixel of a sparse image
constexpr int kWindowPx = 4;      // half window in which the valid pixels are counted
constexpr double kSamples = 1e5;  // pixels of one image that are looked at

template <typename T>
double Median(std::vector<T>& values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return static_cast<double>(*middle);
}

// Distance per pixel to the next valid pixel in one direction; NaN if there is none near.
float PitchTowards(const RangeImage& range, int x, int y, int dx, int dy) {
  for (int step = 1; step <= kMaxStepPx; ++step) {
    const int next_x = x + step * dx;
    const int next_y = y + step * dy;
    if (next_x >= range.width || next_y >= range.height) break;
    if (!IsValid(range, next_x, next_y)) continue;
    return (range.points(next_x, next_y) - range.points(x, y)).norm() / static_cast<float>(step);
  }
  return std::numeric_limits<float>::quiet_NaN();
}

double Fill(const RangeImage& range, int x, int y) {
  int num_valid = -1;  // The pixel itself does not count.
  int num_pixels = -1;
  for (int j = std::max(0, y - kWindowPx); j <= std::min(range.height - 1, y + kWindowPx); ++j) {
    for (int i = std::max(0, x - kWindowPx); i <= std::min(range.width - 1, x + kWindowPx); ++i) {
      ++num_pixels;
      num_valid += IsValid(range, i, j) ? 1 : 0;
    }
  }
  return num_pixels > 0 ? static_cast<double>(num_valid) / num_pixels : 0.0;
}

}  // namespace

double FillRatio(const RangeImage& range) {
  const double num_pixels = static_cast<double>(range.width) * range.height;
  const int step = std::max(1, static_cast<int>(std::sqrt(num_pixels / kSamples)));
  std::vector<double> fills;
  for (int y = 0; y < range.height; y += step) {
    for (int x = 0; x < range.width; x += step) {
      if (IsValid(range, x, y)) fills.push_back(Fill(range, x, y));
    }
  }
  return Median(fills);
}

double MedianPointSpacing(const std::vector<const RangeImage*>& ranges) {
  std::vector<float> spacings;
  for (const RangeImage* range : ranges) {
    const auto per_point = static_cast<float>(1.0 / std::sqrt(FillRatio(*range)));
    for (int y = 0; y < range->height; ++y) {
      for (int x = 0; x < range->width; ++x) {
        if (!IsValid(*range, x, y)) continue;
        for (const float pitch :
             {PitchTowards(*range, x, y, 1, 0), PitchTowards(*range, x, y, 0, 1)}) {
          if (std::isfinite(pitch)) spacings.push_back(pitch * per_point);
        }
      }
    }
  }
  return Median(spacings);
}

}  // namespace fringe_fusion
