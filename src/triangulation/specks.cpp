#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

#include "common/constants.hpp"
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

/// Joins the points of one surface.
class SurfaceSets {
 public:
  SurfaceSets(const RangeImage& range, const TriangulationConfig& config)
      : range_(range),
        step_(range, config),
        radius_(2 * config.normal_radius_px),
        sets_(range.points.size()) {}

  [[nodiscard]] std::uint32_t Find(std::uint32_t i) { return sets_.Find(i); }

  /// Joins a pixel with its left and upper neighbour. A sparse cloud (one point per projector cell)
  /// has none there: then with any earlier point of a window as the normal fit takes for those.
  void JoinEarlier(int x, int y) {
    if (!IsValid(range_, x, y)) return;
    const Eigen::Vector3f to_camera = DirectionToCamera(range_.line_of_sight, range_.points(x, y));
    bool has_neighbor = Join(x, y, x - 1, y, to_camera);
    has_neighbor = Join(x, y, x, y - 1, to_camera) || has_neighbor;
    if (has_neighbor) return;
    for (int j = y - radius_; j <= y; ++j) {
      for (int i = x - radius_; i <= x + radius_; ++i) {
        if (j < y || i < x) Join(x, y, i, j, to_camera);
      }
    }
  }

 private:
  // @return whether there is a point to join with.
  bool Join(int x0, int y0, int x1, int y1, const Eigen::Vector3f& to_camera) {
    if (!range_.points.Contains(x1, y1) || !IsValid(range_, x1, y1)) return false;
    if (step_.Connects(x0, y0, x1, y1, to_camera)) sets_.Join(Index(x0, y0), Index(x1, y1));
    return true;
  }
  [[nodiscard]] std::uint32_t Index(int x, int y) const {
    return static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(range_.width) +
           static_cast<std::uint32_t>(x);
  }

  const RangeImage& range_;
  DepthStep step_;
  int radius_;
  PixelSets sets_;
};

}  // namespace

RangeImage RemoveSpecks(const RangeImage& range, const TriangulationConfig& config) {
  RangeImage out = range;
  SurfaceSets sets(range, config);
  for (int y = 0; y < range.height; ++y) {
    for (int x = 0; x < range.width; ++x) sets.JoinEarlier(x, y);
  }
  std::vector<int> sizes(range.points.size());
  for (std::uint32_t i = 0; i < range.points.size(); ++i) ++sizes[sets.Find(i)];
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
