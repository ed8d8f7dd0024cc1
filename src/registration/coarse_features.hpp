#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "fringe_fusion/registration/view_surface.hpp"

namespace fringe_fusion::internal {

constexpr int kFeatureSize = 33;
using Feature = std::array<float, kFeatureSize>;

/// A view thinned to cells of one size, with a descriptor of the shape around every point.
struct FeatureCloud {
  std::vector<Eigen::Vector3f> points;   ///< mean of a cell, camera frame [m]
  std::vector<Eigen::Vector3f> normals;  ///< unit
  std::vector<Feature> features;
};

/// Edge of the cells with which a view of the median size has `max_points` of them [m].
[[nodiscard]] double FeatureCell(const SurfaceSet& set, int max_points);

/// Thins the inner points of a view and computes fast point feature histograms.
/// @param radius_m of the neighbourhood.
/// Ref: Rusu, Blodow, Beetz, Fast Point Feature Histograms (FPFH) for 3D registration, 2009.
[[nodiscard]] FeatureCloud MakeFeatures(const ViewSurface& surface, double cell_m, double radius_m);

/// A point of one cloud and one of the other with a similar neighbourhood.
struct FeatureMatch {
  int first = 0;
  int second = 0;
};

/// The `count` most similar points of the other cloud for every point, from both sides.
[[nodiscard]] std::vector<FeatureMatch> MatchFeatures(const FeatureCloud& first,
                                                      const FeatureCloud& second, int count);

}  // namespace fringe_fusion::internal
