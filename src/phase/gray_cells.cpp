#include "gray_cells.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "gray_smoothing.hpp"

namespace fringe_fusion::decode {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr std::int64_t kNoCell = -1;
// Long enough a base that the slope of rounded values does not lock in with the cells.
constexpr int kSlopeRadiusPx = 5;

// Number of the cell, or kNoCell where the coordinate is not the centre of a finest cell.
std::int64_t CellOf(float coordinate_px, float sigma_px, const GrayCode& code) {
  if (!std::isfinite(coordinate_px)) return kNoCell;
  const double cell = code.cell_px;
  if (static_cast<double>(sigma_px) > 1.01 * cell / std::sqrt(12.0)) return kNoCell;
  const double number = (static_cast<double>(coordinate_px) + 0.5 - code.offset_px) / cell - 0.5;
  const double rounded = std::round(number);
  return std::abs(number - rounded) < 0.1 ? static_cast<std::int64_t>(rounded) : kNoCell;
}

Image<std::int64_t> NumberCells(const PhaseMap& map, const GrayCode& code_u,
                                const GrayCode& code_v) {
  Image<std::int64_t> cells(map.width, map.height, kNoCell);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const std::int64_t u = CellOf(map.u[i], map.sigma_u[i], code_u);
    const std::int64_t v = CellOf(map.v[i], map.sigma_v[i], code_v);
    if (u != kNoCell && v != kNoCell) cells[i] = (v << 32) + u;
  }
  return cells;
}

/// Collects the connected pixels of one cell and takes them out of the image.
class CellGroups {
 public:
  explicit CellGroups(Image<std::int64_t> cells) : cells_(std::move(cells)) {}

  /// @return the group of the pixel, first itself; empty if it has no cell or was taken before.
  const std::vector<Eigen::Vector2i>& Take(int x, int y) {
    group_.clear();
    const std::int64_t cell = cells_(x, y);
    if (cell == kNoCell) return group_;
    Add(x, y);
    for (std::size_t next = 0; next < group_.size(); ++next) {
      const Eigen::Vector2i at = group_[next];
      for (int j = at.y() - 1; j <= at.y() + 1; ++j) {
        for (int i = at.x() - 1; i <= at.x() + 1; ++i) {
          if (cells_.Contains(i, j) && cells_(i, j) == cell) Add(i, j);
        }
      }
    }
    return group_;
  }

 private:
  void Add(int x, int y) {
    cells_(x, y) = kNoCell;
    group_.emplace_back(x, y);
  }

  Image<std::int64_t> cells_;
  std::vector<Eigen::Vector2i> group_;
};

struct Centre {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Vector2i nearest = Eigen::Vector2i::Zero();
};

Centre CentreOf(const std::vector<Eigen::Vector2i>& group) {
  Centre out;
  for (const Eigen::Vector2i& at : group) out.mean += at.cast<double>();
  out.mean /= static_cast<double>(group.size());
  double least = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector2i& at : group) {
    const double distance = (at.cast<double>() - out.mean).squaredNorm();
    if (distance < least) {
      least = distance;
      out.nearest = at;
    }
  }
  return out;
}

struct Coordinate {
  float value_px = 0.0F;
  float sigma_px = 0.0F;
};

// The cell centre belongs to the mean of the group; its pixel lies beside it. All pixels of the
// group lie in the cell: that leaves its mean an interval as long as the cell less the extent of
// the group, where it lies anywhere.
Coordinate PlaceGroup(const CoordinateImage& code, const std::vector<Eigen::Vector2i>& group,
                      const Centre& centre, float max_step_px) {
  const Eigen::Vector2i& at = centre.nearest;
  Coordinate out{code.value_px(at.x(), at.y()), code.sigma_px(at.x(), at.y())};
  const std::optional<LocalPlane> plane =
      FitLocalPlane(code, at.x(), at.y(), kSlopeRadiusPx, max_step_px);
  if (!plane) return out;
  const double cell_px = std::sqrt(12.0) * static_cast<double>(out.sigma_px);
  double low = 0.0;
  double high = 0.0;
  for (const Eigen::Vector2i& pixel : group) {
    const double along = plane->slope_px_px.dot(pixel.cast<double>() - centre.mean);
    low = std::min(low, along);
    high = std::max(high, along);
  }
  // The slope is not exact, and noise moves pixels on the border to the wrong cell.
  const double least_px = 0.5 * cell_px / std::sqrt(static_cast<double>(group.size()));
  const double length_px = std::max(cell_px - (high - low), least_px);
  const double middle_px = 0.5 * (low + high);
  const double moved_px = plane->slope_px_px.dot(at.cast<double>() - centre.mean);
  out.value_px += static_cast<float>(moved_px);
  out.sigma_px =
      static_cast<float>(std::sqrt(length_px * length_px / 12.0 + middle_px * middle_px));
  return out;
}

}  // namespace

PhaseMap KeepOnePixelPerCell(PhaseMap map, const GrayCode& code_u, const GrayCode& code_v,
                             const PhaseConfig& config) {
  const CoordinateImage u{map.u, map.sigma_u};
  const CoordinateImage v{map.v, map.sigma_v};
  CellGroups groups(NumberCells(map, code_u, code_v));
  const auto max_step_px = static_cast<float>(config.max_edge_step_px);
  for (std::size_t i = 0; i < map.mask.size(); ++i) {
    if (map.mask[i] == 0) map.mask[i] = static_cast<std::uint8_t>(MaskReason::kDoubtfulOrder);
    map.u[i] = map.v[i] = map.sigma_u[i] = map.sigma_v[i] = kNan;
  }
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const std::vector<Eigen::Vector2i>& group = groups.Take(x, y);
      if (group.empty()) continue;
      for (const Eigen::Vector2i& at : group) {
        map.mask(at.x(), at.y()) = static_cast<std::uint8_t>(MaskReason::kMerged);
      }
      const Centre centre = CentreOf(group);
      const int cx = centre.nearest.x();
      const int cy = centre.nearest.y();
      const Coordinate placed_u = PlaceGroup(u, group, centre, max_step_px);
      const Coordinate placed_v = PlaceGroup(v, group, centre, max_step_px);
      map.u(cx, cy) = placed_u.value_px;
      map.v(cx, cy) = placed_v.value_px;
      map.sigma_u(cx, cy) = placed_u.sigma_px;
      map.sigma_v(cx, cy) = placed_v.sigma_px;
      map.mask(cx, cy) = 0;
    }
  }
  return map;
}

}  // namespace fringe_fusion::decode
