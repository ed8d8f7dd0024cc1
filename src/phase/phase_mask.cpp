#include "phase_mask.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::decode {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr int kRowsPerChunk = 16;

// True where both neighbours along one direction differ by more than the step; a missing one
// counts as different, two missing ones tell nothing.
bool JumpsOnBothSides(float here, float before, float after, float step) {
  const bool has_before = std::isfinite(before);
  const bool has_after = std::isfinite(after);
  if (!has_before && !has_after) return false;
  const bool near_before = has_before && std::abs(here - before) <= step;
  const bool near_after = has_after && std::abs(here - after) <= step;
  return !near_before && !near_after;
}

bool IsSpike(const Image<float>& image, int x, int y, float step) {
  if (image.empty()) return false;
  const auto at = [&](int i, int j) { return image.Contains(i, j) ? image(i, j) : kNan; };
  const float here = image(x, y);
  return JumpsOnBothSides(here, at(x - 1, y), at(x + 1, y), step) ||
         JumpsOnBothSides(here, at(x, y - 1), at(x, y + 1), step);
}

// B / A does not depend on the albedo, so a texture edge stays and a blend of two phases falls.
bool IsMixed(const PhaseMap& map, int x, int y, float least_ratio) {
  std::array<float, 9> ratios{};
  std::size_t count = 0;
  for (int j = std::max(0, y - 1); j <= std::min(map.height - 1, y + 1); ++j) {
    for (int i = std::max(0, x - 1); i <= std::min(map.width - 1, x + 1); ++i) {
      if (map.mask(i, j) == 0) ratios[count++] = map.modulation(i, j) / map.offset(i, j);
    }
  }
  auto* middle = ratios.begin() + count / 2;
  std::nth_element(ratios.begin(), middle, ratios.begin() + count);
  return !(map.modulation(x, y) / map.offset(x, y) >= least_ratio * *middle);
}

}  // namespace

PhaseMap MaskEdges(PhaseMap map, const PhaseConfig& config) {
  Image<std::uint8_t> edges(map.width, map.height);
  const auto step = static_cast<float>(config.max_edge_step_px);
  const auto least_ratio = static_cast<float>(config.min_mixed_ratio);
  ParallelFor(map.height, kRowsPerChunk, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < map.width; ++x) {
        if (map.mask(x, y) != 0) continue;
        const bool edge = IsSpike(map.u, x, y, step) || IsSpike(map.v, x, y, step) ||
                          IsMixed(map, x, y, least_ratio);
        edges(x, y) = edge ? 1 : 0;
      }
    }
  });
  for (std::size_t i = 0; i < edges.size(); ++i) {
    if (edges[i] == 0) continue;
    map.mask[i] = static_cast<std::uint8_t>(MaskReason::kEdge);
    for (Image<float>* image : {&map.u, &map.v, &map.sigma_u, &map.sigma_v}) {
      if (!image->empty()) (*image)[i] = kNan;
    }
  }
  return map;
}

}  // namespace fringe_fusion::decode
