#pragma once

#include <stdexcept>
#include <utility>
#include <vector>

#include "test/fusion/synthetic_views.hpp"

namespace fringe_fusion::bench {

/// A ball of 100 mm diameter that fills a camera of width x height pixels.
inline View BallView(int id, int width, int height, const Eigen::Vector3d& direction) {
  testing::ViewSettings settings;
  settings.width = width;
  settings.height = height;
  settings.focal_px = 2.4 * height;
  settings.sigma_range_m = 5e-5;
  return testing::CastView(id, testing::SphereScene(0.05), direction.normalized() * 0.3, settings);
}

/// Views all around the ball.
inline std::vector<View> BallViews(int count, int width, int height) {
  std::vector<View> views;
  for (int i = 0; i < count; ++i) {
    const double angle = 2.4 * i;  // golden angle: evenly spread on the sphere
    const double z = -1.0 + 2.0 * (i + 0.5) / count;
    const double r = std::sqrt(1.0 - z * z);
    views.push_back(
        BallView(i, width, height, Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle), z)));
  }
  return views;
}

inline ImplicitModel MakeModel(double voxel_m) {
  FusionConfig config;
  config.voxel_m = voxel_m;
  Result<ImplicitModel> model = ImplicitModel::Create(config);
  if (!model) throw std::runtime_error(model.error().message);
  return std::move(*model);
}

}  // namespace fringe_fusion::bench
