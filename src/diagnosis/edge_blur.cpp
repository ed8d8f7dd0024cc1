#include "edge_blur.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace fringe_fusion::diagnosis {
namespace {

constexpr int kReachPx = 9;          // [px] to both sides of an edge
constexpr double kMinHeight = 0.25;  // of an edge, of the brightest level
constexpr double kPercentile = 0.2;  // of the edges' widths, from the sharpest
const double kSqrtTwoPi = std::sqrt(6.28318530717958647692);

float Percentile(std::vector<float> values, double part) {
  const auto at = values.begin() +
                  static_cast<std::ptrdiff_t>(part * (static_cast<double>(values.size()) - 1.0));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// Widths of the edges along one line of `count` values that lie `stride` apart.
void CollectEdges(const float* line, int count, std::ptrdiff_t stride, float min_height,
                  std::vector<float>& widths) {
  const auto at = [&](int i) { return line[i * stride]; };
  for (int i = kReachPx; i + kReachPx + 1 < count; ++i) {
    const float slope = std::abs(at(i + 1) - at(i));
    if (!(slope * 12.0F > min_height)) continue;
    bool steepest = true;
    for (int k = -kReachPx; steepest && k <= kReachPx; ++k) {
      const float other = std::abs(at(i + k + 1) - at(i + k));
      steepest = other < slope || (other == slope && k >= 0);
    }
    if (!steepest) continue;
    const float after = (at(i + kReachPx) + at(i + kReachPx + 1)) / 2.0F;
    const float before = (at(i - kReachPx) + at(i - kReachPx + 1)) / 2.0F;
    const float height = std::abs(after - before);
    if (height > min_height) widths.push_back(height / (static_cast<float>(kSqrtTwoPi) * slope));
  }
}

}  // namespace

EdgeBlur MeasureEdgeBlur(const Image<float>& mean) {
  EdgeBlur blur;
  if (mean.width() < 2 * kReachPx + 2 || mean.height() < 2 * kReachPx + 2) return blur;
  const float brightest = Percentile(std::vector<float>(mean.begin(), mean.end()), 0.99);
  const auto min_height = static_cast<float>(kMinHeight) * brightest;
  std::vector<float> widths;
  for (int y = 0; y < mean.height(); ++y) {
    CollectEdges(mean.row(y), mean.width(), 1, min_height, widths);
  }
  for (int x = 0; x < mean.width(); ++x) {
    CollectEdges(mean.data() + x, mean.height(), mean.width(), min_height, widths);
  }
  blur.num_edges = static_cast<int>(widths.size());
  if (!widths.empty()) blur.sigma_px = static_cast<double>(Percentile(widths, kPercentile));
  return blur;
}

}  // namespace fringe_fusion::diagnosis
