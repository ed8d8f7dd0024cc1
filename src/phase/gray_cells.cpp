#include "gray_cells.hpp"

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "common/constants.hpp"
#include "gray_smoothing.hpp"

namespace fringe_fusion::decode {
namespace {

constexpr std::int64_t kNoCell = -1;
constexpr int kSlopeRadiusPx = 2;

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

// The cell centre belongs to the mean of the group; its pixel lies `shift` beside it.
float MoveToPixel(const CoordinateImage& code, const Centre& centre, float max_step_px) {
  const Eigen::Vector2i& at = centre.nearest;
  const std::optional<LocalPlane> plane =
      FitLocalPlane(code, at.x(), at.y(), kSlopeRadiusPx, max_step_px);
  const Eigen::Vector2d shift = at.cast<double>() - centre.mean;
  const double moved_px = plane ? plane->slope_px_px.dot(shift) : 0.0;
  return code.value_px(at.x(), at.y()) + static_cast<float>(moved_px);
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
      // Pixels lie at random in their cell: each is one sample of a uniform distribution.
      const float share = 1.0F / std::sqrt(static_cast<float>(group.size()));
      map.u(cx, cy) = MoveToPixel(u, centre, max_step_px);
      map.v(cx, cy) = MoveToPixel(v, centre, max_step_px);
      map.sigma_u(cx, cy) = share * u.sigma_px(cx, cy);
      map.sigma_v(cx, cy) = share * v.sigma_px(cx, cy);
      map.mask(cx, cy) = 0;
    }
  }
  return map;
}

}  // namespace fringe_fusion::decode
