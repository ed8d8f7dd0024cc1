#include "print_edges.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

namespace fringe_fusion::internal {
namespace {

/// Nearest place of a shape's edge.
Eigen::Vector2d NearestOnEdge(const PrintShape& shape, const Eigen::Vector2d& point) {
  const Eigen::Vector2d d = point - shape.centre_m;
  if (shape.is_disc) {
    const double norm = d.norm();
    const Eigen::Vector2d direction =
        norm > 0.0 ? Eigen::Vector2d(d / norm) : Eigen::Vector2d(1, 0);
    return shape.centre_m + shape.half_size_m.x() * direction;
  }
  const Eigen::Vector2d inside = shape.half_size_m - d.cwiseAbs();
  Eigen::Vector2d nearest = d.cwiseMax(-shape.half_size_m).cwiseMin(shape.half_size_m);
  if (inside.minCoeff() > 0.0) {
    const Eigen::Index axis = inside.x() < inside.y() ? 0 : 1;
    nearest[axis] = std::copysign(shape.half_size_m[axis], d[axis]);
  }
  return shape.centre_m + nearest;
}

}  // namespace

PrintEdges::PrintEdges(const CalibrationTarget& target)
    : cell_m_(target.pitch_m), print_(MakeTargetPrint(target)) {
  for (std::size_t i = 0; i < print_.shapes.size(); ++i) {
    const PrintShape& shape = print_.shapes[i];
    const Eigen::Vector2d reach = shape.half_size_m + Eigen::Vector2d::Constant(0.5 * cell_m_);
    const auto [x0, y0] = Cell(shape.centre_m - reach);
    const auto [x1, y1] = Cell(shape.centre_m + reach);
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) shapes_[{x, y}].push_back(static_cast<int>(i));
    }
  }
}

std::pair<int, int> PrintEdges::Cell(const Eigen::Vector2d& point) const {
  return {static_cast<int>(std::floor(point.x() / cell_m_)),
          static_cast<int>(std::floor(point.y() / cell_m_))};
}

double PrintEdges::Distance(const Eigen::Vector2d& point,
                            const Eigen::Matrix2d& pixel_by_point) const {
  double least = std::numeric_limits<double>::infinity();
  const auto cell = shapes_.find(Cell(point));
  if (cell == shapes_.end()) return least;
  for (const int i : cell->second) {
    const PrintShape& shape = print_.shapes[static_cast<std::size_t>(i)];
    const Eigen::Vector2d apart = NearestOnEdge(shape, point) - point;
    least = std::min(least, (pixel_by_point * apart).norm());
  }
  return least;
}

}  // namespace fringe_fusion::internal
