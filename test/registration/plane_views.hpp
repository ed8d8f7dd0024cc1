#pragma once

#include <random>

#include "fringe_fusion/pose/view.hpp"

namespace fringe_fusion::testing {

/// A flat square seen head-on by parallel rays: z = 0 of its own frame, sensor towards +z.
struct PlaneScene {
  int side_px = 60;
  double step_m = 0.5e-3;  ///< between neighbouring points
  double sigma_range_m = 0.0;
  double sigma_normal_rad = 0.0;
  unsigned seed = 1;
};

inline View MakePlaneView(const PlaneScene& scene, int id) {
  std::mt19937 random(scene.seed + static_cast<unsigned>(id));
  std::normal_distribution<double> gauss;
  View view;
  view.id = id;
  view.name = "plane" + std::to_string(id);
  view.pose.source = PoseSource::kFile;
  view.range = MakeRangeImage(scene.side_px, scene.side_px);
  view.range.line_of_sight.directional = true;
  view.range.line_of_sight.camera = Eigen::Vector3f::UnitZ();
  for (int y = 0; y < scene.side_px; ++y) {
    for (int x = 0; x < scene.side_px; ++x) {
      const Eigen::Vector3d point((x - 0.5 * scene.side_px) * scene.step_m,
                                  (y - 0.5 * scene.side_px) * scene.step_m,
                                  scene.sigma_range_m * gauss(random));
      const Eigen::Vector3d normal(scene.sigma_normal_rad * gauss(random),
                                   scene.sigma_normal_rad * gauss(random), 1.0);
      view.range.points(x, y) = point.cast<float>();
      view.range.normals(x, y) = normal.normalized().cast<float>();
      if (scene.sigma_range_m > 0.0) {
        view.range.sigma_range(x, y) = static_cast<float>(scene.sigma_range_m);
        view.range.sigma_lateral(x, y) = static_cast<float>(scene.sigma_range_m);
      }
    }
  }
  return view;
}

}  // namespace fringe_fusion::testing
