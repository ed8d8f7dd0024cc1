#include "border_taper.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::internal {
namespace {

// Neighbours of a depth step are both marked: which of the two is the mixed pixel is not known.
bool IsStep(const RangeImage& range, std::size_t a, std::size_t b, double step_m) {
  const Eigen::Vector3f between = range.points[b] - range.points[a];
  const float off_a = std::abs(range.normals[a].dot(between));
  const float off_b = std::abs(range.normals[b].dot(between));
  return !(static_cast<double>(std::min(off_a, off_b)) <= step_m);
}

std::size_t PixelIndex(const RangeImage& range, int x, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(range.width) +
         static_cast<std::size_t>(x);
}

// Points that no two of their neighbours confirm: spikes. A rib of one pixel keeps the two along
// it.
Image<std::uint8_t> FindSpikes(const RangeImage& range, double step_m) {
  // A surface seen at 83 deg; a spike of a grazing ray hardly leaves the tangent plane.
  constexpr double kMaxGapInSpacings = 8.0;
  const double max_gap_m = kMaxGapInSpacings * PointSpacing(range);
  const auto confirms = [&](std::size_t a, std::size_t b) {
    const auto gap_m = static_cast<double>((range.points[b] - range.points[a]).norm());
    return gap_m <= max_gap_m && !IsStep(range, a, b, step_m);
  };
  Image<std::uint8_t> spikes(range.width, range.height, 0);
  ParallelFor(range.height, 16, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < range.width; ++x) {
        if (!IsValid(range, x, y)) continue;
        int num_confirmed = 0;
        for (int i = 0; i < 9 && num_confirmed < 2; ++i) {
          const int nx = x + i % 3 - 1;
          const int ny = y + i / 3 - 1;
          if (i == 4 || !range.points.Contains(nx, ny) || !IsValid(range, nx, ny)) continue;
          if (confirms(PixelIndex(range, x, y), PixelIndex(range, nx, ny))) ++num_confirmed;
        }
        if (num_confirmed < 2) spikes(x, y) = 1;
      }
    }
  });
  return spikes;
}

// Zero where a surface ends. A spike is neither surface nor the end of one.
cv::Mat InteriorMask(const RangeImage& range, const Image<std::uint8_t>& spikes, double step_m) {
  // One pixel of frame: the view ends at the image border as well.
  cv::Mat mask = cv::Mat::zeros(range.height + 2, range.width + 2, CV_8U);
  for (int y = 0; y < range.height; ++y) {
    for (int x = 0; x < range.width; ++x) {
      if (IsValid(range, x, y)) mask.at<std::uint8_t>(y + 1, x + 1) = 255;
    }
  }
  const auto on_surface = [&](int x, int y) { return IsValid(range, x, y) && spikes(x, y) == 0; };
  const auto mark = [&](int x0, int y0, int x1, int y1) {
    if (!on_surface(x0, y0) || !on_surface(x1, y1)) return;
    if (!IsStep(range, PixelIndex(range, x0, y0), PixelIndex(range, x1, y1), step_m)) return;
    mask.at<std::uint8_t>(y0 + 1, x0 + 1) = 0;
    mask.at<std::uint8_t>(y1 + 1, x1 + 1) = 0;
  };
  for (int y = 0; y < range.height; ++y) {
    for (int x = 0; x < range.width; ++x) {
      if (x + 1 < range.width) mark(x, y, x + 1, y);
      if (y + 1 < range.height) mark(x, y, x, y + 1);
    }
  }
  return mask;
}

double MedianStep(const RangeImage& range, int step_x, int step_y) {
  // A few thousand pairs fix the median well enough.
  constexpr int kMaxRows = 64;
  const int row_stride = std::max(1, range.height / kMaxRows);
  std::vector<float> steps;
  for (int y = 0; y + step_y < range.height; y += row_stride) {
    for (int x = 0; x + step_x < range.width; ++x) {
      const Eigen::Vector3f between = range.points(x + step_x, y + step_y) - range.points(x, y);
      if (between.allFinite()) steps.push_back(between.norm());
    }
  }
  if (steps.empty()) return 0.0;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return static_cast<double>(*middle);
}

}  // namespace

Image<float> BorderTaper(const RangeImage& range, double taper_px, double step_m) {
  Image<float> taper(range.width, range.height, 1.0F);
  const bool has_structure = range.width > 1 && range.height > 1;
  if (!has_structure) return taper;
  const Image<std::uint8_t> spikes = FindSpikes(range, step_m);
  for (std::size_t i = 0; i < spikes.size(); ++i) {
    if (spikes[i] != 0) taper[i] = 0.0F;
  }
  if (!(taper_px > 0.0)) return taper;
  cv::Mat distance;
  cv::distanceTransform(InteriorMask(range, spikes, step_m), distance, cv::DIST_L2,
                        cv::DIST_MASK_5);
  // A border pixel keeps a little weight: thin ribs are all border and must not vanish.
  constexpr float kBorderDistancePx = 1.0F;
  for (int y = 0; y < range.height; ++y) {
    for (int x = 0; x < range.width; ++x) {
      if (spikes(x, y) != 0) continue;
      const float from_edge = std::max(kBorderDistancePx, distance.at<float>(y + 1, x + 1));
      const float t = std::min(1.0F, from_edge / (static_cast<float>(taper_px) + 1.0F));
      taper(x, y) = t * t * (3.0F - 2.0F * t);
    }
  }
  return taper;
}

double PointSpacing(const RangeImage& range) {
  if (range.width < 2 || range.height < 2) return 0.0;
  return std::max(MedianStep(range, 1, 0), MedianStep(range, 0, 1));
}

}  // namespace fringe_fusion::internal
