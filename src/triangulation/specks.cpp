#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

#include "depth_step.hpp"
#include "fringe_fusion/triangulation/range_image.hpp"

namespace fringe_fusion {
namespace {

using triangulation::DepthStep;

/// Disjoint sets over pixel numbers; the smallest number names a set, so the result does not
/// depend on the order of joining.
class PixelSets {
 public:
  explicit PixelSets(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), 0U);
  }
  [[nodiscard]] std::uint32_t Find(std::uint32_t i) {
    while (parent_[i] != i) {
      parent_[i] = parent_[parent_[i]];
      i = parent_[i];
    }
    return i;
  }
  void Join(std::uint32_t a, std::uint32_t b) {
    a = Find(a);
    b = Find(b);
    if (a < b) {
      parent_[b] = a;
    } else {
      parent_[a] = b;
    }
  }

 private:
  std::vector<std::uint32_t> parent_;
};

}  // namespace

RangeImage RemoveSpecks(const RangeImage& range, const TriangulationConfig& config) {
  RangeImage out = range;
  PixelSets sets(range.points.size());
  const DepthStep step(range, config);
  const auto index = [&](int x, int y) {
    return static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(range.width) +
           static_cast<std::uint32_t>(x);
  };
  for (int y = 0; y < range.height; ++y) {
    for (int x = 0; x < range.width; ++x) {
      if (!IsValid(range, x, y)) continue;
      const Eigen::Vector3f to_camera = DirectionToCamera(range.line_of_sight, range.points(x, y));
      if (x > 0 && step.Connects(x, y, x - 1, y, to_camera))
        sets.Join(index(x, y), index(x - 1, y));
      if (y > 0 && step.Connects(x, y, x, y - 1, to_camera))
        sets.Join(index(x, y), index(x, y - 1));
    }
  }
  std::vector<int> sizes(range.points.size());
  for (std::uint32_t i = 0; i < range.points.size(); ++i) ++sizes[sets.Find(i)];
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  for (std::uint32_t i = 0; i < range.points.size(); ++i) {
    if (sizes[sets.Find(i)] >= config.min_component_px) continue;
    out.points[i].setConstant(kNan);
    out.normals[i].setConstant(kNan);
    out.sigma_range[i] = kNan;
    out.sigma_lateral[i] = kNan;
  }
  return out;
}

}  // namespace fringe_fusion
