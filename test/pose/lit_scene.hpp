#pragma once

#include <random>
#include <vector>

#include "fringe_fusion/pose/view_pose.hpp"
#include "test/pose/epipolar_scene.hpp"

namespace fringe_fusion::testing {

/// The projector at rest.
inline CameraModel LitProjector() {
  return {1280, 800, 1900.0, 1900.0, 639.5, 399.5, {-0.05, 0.02, 0.0, 0.0, 0.0}};
}

/// Points of a relief with noise of 0.02 mm, seen with noise of 0.1 px.
inline std::vector<LitPoint> Lit(const Transform& T_projector_rig, int grid, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> unit;
  const auto depth = Relief(0.035);
  constexpr double kSigmaPx = 0.1;
  constexpr double kSigmaM = 2e-5;
  std::vector<LitPoint> points;
  for (int y = 0; y < grid; ++y) {
    for (int x = 0; x < grid; ++x) {
      const Eigen::Vector2d ray(0.36 * ((x + 0.5) / grid - 0.5), 0.3 * ((y + 0.5) / grid - 0.5));
      const Eigen::Vector3d point = depth(ray) * ray.homogeneous();
      LitPoint lit;
      lit.projector_px = Project(LitProjector(), T_projector_rig * point) +
                         kSigmaPx * Eigen::Vector2d(unit(engine), unit(engine));
      lit.covariance_px2 = kSigmaPx * kSigmaPx * Eigen::Matrix2d::Identity();
      lit.point_rig = point + kSigmaM * Eigen::Vector3d(unit(engine), unit(engine), unit(engine));
      lit.covariance_m2 = kSigmaM * kSigmaM * Eigen::Matrix3d::Identity();
      points.push_back(lit);
    }
  }
  return points;
}

inline Transform FarProjector() {
  return LookFrom({-0.35, 0.1, -0.2}, {0.0, 0.0, 0.7}, {0.02, 0.0, 0.1});
}

}  // namespace fringe_fusion::testing
