#include "space_grid.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::internal {
namespace {

using Flags = std::vector<std::atomic<std::uint8_t>>;

// Walks the cells (of one step, centred on the nodes) along a ray and flags their nodes.
// Ref: Amanatides and Woo, A fast voxel traversal algorithm for ray tracing, 1987.
class Carver {
 public:
  Carver(const SpaceGrid& grid, Flags& flags) : grid_(grid), flags_(flags) {}

  // From a point on, as far as `length` or the end of the grid.
  void Carve(const Eigen::Vector3d& from, const Eigen::Vector3d& direction, double length) const {
    // In cells: cell i spans [i, i + 1).
    Eigen::Vector3d start = (from - grid_.origin) / grid_.step + Eigen::Vector3d::Constant(0.5);
    double begin = 0.0;
    double end = length / grid_.step;
    if (!Clip(start, direction, begin, end)) return;
    start += begin * direction;
    end -= begin;
    std::array<int, 3> cell{};
    std::array<int, 3> step{};
    std::array<double, 3> next{};
    std::array<double, 3> delta{};
    for (std::size_t a = 0; a < 3; ++a) {
      const auto axis = static_cast<int>(a);
      cell[a] = std::clamp(static_cast<int>(std::floor(start[axis])), 0, grid_.size[a] - 1);
      const double d = direction[axis];
      step[a] = d > 0.0 ? 1 : -1;
      delta[a] = d != 0.0 ? std::abs(1.0 / d) : std::numeric_limits<double>::infinity();
      const double to_face = d > 0.0 ? cell[a] + 1 - start[axis] : start[axis] - cell[a];
      next[a] = d != 0.0 ? to_face * delta[a] : std::numeric_limits<double>::infinity();
    }
    while (true) {
      flags_[grid_.Index(cell[0], cell[1], cell[2])].store(1, std::memory_order_relaxed);
      const auto a =
          static_cast<std::size_t>(std::min_element(next.begin(), next.end()) - next.begin());
      if (next[a] > end) return;
      cell[a] += step[a];
      next[a] += delta[a];
      if (cell[a] < 0 || cell[a] >= grid_.size[a]) return;
    }
  }

 private:
  // The part [begin, end] of the ray inside the grid.
  [[nodiscard]] bool Clip(const Eigen::Vector3d& start, const Eigen::Vector3d& direction,
                          double& begin, double& end) const {
    for (std::size_t a = 0; a < 3; ++a) {
      const auto axis = static_cast<int>(a);
      const double high = grid_.size[a];
      if (direction[axis] == 0.0) {
        if (!(start[axis] >= 0.0 && start[axis] < high)) return false;
        continue;
      }
      double t0 = -start[axis] / direction[axis];
      double t1 = (high - start[axis]) / direction[axis];
      if (t0 > t1) std::swap(t0, t1);
      begin = std::max(begin, t0);
      end = std::min(end, t1);
    }
    return begin < end;
  }

  const SpaceGrid& grid_;
  Flags& flags_;
};

void CarveView(const Carver& carver, const View& view, double clearance_m) {
  const RangeImage& range = view.range;
  const Transform& T_object_camera = view.pose.T_object_camera;
  const double far_m = 1e6;
  ParallelFor(range.height, 8, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < range.width; ++x) {
        const Eigen::Vector3f& point_camera = range.points(x, y);
        if (!point_camera.allFinite()) continue;
        const Eigen::Vector3d point = T_object_camera * point_camera.cast<double>();
        const auto sigma = static_cast<double>(range.sigma_range(x, y));
        const double clearance = clearance_m + (sigma > 0.0 ? 3.0 * sigma : 0.0);
        const auto look = [&](const Eigen::Vector3d& towards, double distance) {
          if (!(distance > clearance)) return;
          carver.Carve(point + clearance * towards, towards, distance - clearance);
        };
        look(T_object_camera.linear() *
                 DirectionToCamera(range.line_of_sight, point_camera).cast<double>(),
             range.line_of_sight.directional
                 ? far_m
                 : static_cast<double>((range.line_of_sight.camera - point_camera).norm()));
        if (!range.line_of_sight.projector) continue;
        const Eigen::Vector3d to_projector =
            T_object_camera * range.line_of_sight.projector->cast<double>() - point;
        look(to_projector.normalized(), to_projector.norm());
      }
    }
  });
}

}  // namespace

void CarveEmpty(const SpaceGrid& grid, const std::vector<const View*>& views, double clearance_m,
                std::vector<Space>& states) {
  Flags flags(grid.count());
  const Carver carver(grid, flags);
  for (const View* view : views) CarveView(carver, *view, clearance_m);
  for (std::size_t i = 0; i < states.size(); ++i) {
    if (flags[i].load(std::memory_order_relaxed) != 0 && states[i] == Space::kUnknown) {
      states[i] = Space::kEmpty;
    }
  }
}

std::vector<float> DepthOfEmpty(const SpaceGrid& grid, const std::vector<Space>& states,
                                int limit) {
  std::vector<float> depth(grid.count(), 0.0F);
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if (states[i] == Space::kEmpty) depth[i] = static_cast<float>(limit);
  }
  // Largest step along any axis: a lower bound of the distance, grown layer by layer.
  std::vector<float> before;
  for (int layer = 1; layer < limit; ++layer) {
    before = depth;
    ParallelFor(grid.size[2], 4, [&](int begin, int end) {
      for (int z = begin; z < end; ++z) {
        for (int y = 0; y < grid.size[1]; ++y) {
          for (int x = 0; x < grid.size[0]; ++x) {
            const std::size_t i = grid.Index(x, y, z);
            if (!(before[i] > static_cast<float>(layer))) continue;
            float least = before[i];
            for (int dz = std::max(0, z - 1); dz <= std::min(grid.size[2] - 1, z + 1); ++dz) {
              for (int dy = std::max(0, y - 1); dy <= std::min(grid.size[1] - 1, y + 1); ++dy) {
                for (int dx = std::max(0, x - 1); dx <= std::min(grid.size[0] - 1, x + 1); ++dx) {
                  least = std::min(least, before[grid.Index(dx, dy, dz)] + 1.0F);
                }
              }
            }
            depth[i] = least;
          }
        }
      }
    });
  }
  return depth;
}

}  // namespace fringe_fusion::internal
