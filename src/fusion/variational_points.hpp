#pragma once

#include <cstdint>
#include <vector>

#include "fringe_fusion/fusion/variational_surface.hpp"
#include "variational_fit.hpp"

namespace fringe_fusion::internal {

/// The points that can be used: finite, with a normal and a sigma.
[[nodiscard]] std::vector<MeasuredPoint> UsablePoints(const std::vector<MeasuredPoint>& points,
                                                      double min_sigma_m);

/// Points in the order of the cells of a regular grid.
class PointGrid {
 public:
  /// @param points borrowed.
  PointGrid(const std::vector<MeasuredPoint>& points, double cell_m);
  /// Indices of the points within a box, in the order of the grid.
  [[nodiscard]] std::vector<std::uint32_t> Within(const Eigen::Vector3f& middle, float half) const;
  /// Indices of all points, cell by cell.
  [[nodiscard]] const std::vector<std::uint32_t>& order() const { return order_; }
  /// Where the cells begin in order(); the last entry closes the list.
  [[nodiscard]] const std::vector<std::uint32_t>& begins() const { return begins_; }

 private:
  [[nodiscard]] std::uint64_t KeyOf(const Eigen::Vector3f& position) const;
  const std::vector<MeasuredPoint>* points_;
  Eigen::Vector3f low_;
  float cell_m_;
  std::vector<std::uint64_t> keys_;  // one per cell, ascending
  std::vector<std::uint32_t> begins_;
  std::vector<std::uint32_t> order_;
};

/// A centre and what its points had in common.
struct MergedPoints {
  std::vector<Center> centers;
  std::vector<Rgb8> colors;
  std::vector<std::uint8_t> num_views;
};

/// One centre for the points of each cell whose normals face the same half space: their weighted
/// mean. On a bent patch that lies off the surface by half of what the points deviate along their
/// normals from it; this is the centre's value.
[[nodiscard]] MergedPoints MergePoints(const std::vector<MeasuredPoint>& points,
                                       const PointGrid& grid);

/// Every point a centre.
[[nodiscard]] MergedPoints KeepPoints(const std::vector<MeasuredPoint>& points);

/// Appends the centres of some points; `cell` are indices, in the order they are merged.
void AppendMerged(const std::vector<MeasuredPoint>& points, const std::uint32_t* begin,
                  const std::uint32_t* end, MergedPoints& merged);

/// How densely a surface is measured; medians over places spread over it.
struct SurfaceDensity {
  double spacing_m = 0.0;  ///< 1 / sqrt(points per area); 0 if all points coincide
  double sigma_m = 0.0;  ///< of equal points that would tell as much; 0: no place has a few points
};
[[nodiscard]] SurfaceDensity MeasureDensity(const std::vector<MeasuredPoint>& points);

}  // namespace fringe_fusion::internal
