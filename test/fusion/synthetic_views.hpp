#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "fringe_fusion/fusion/implicit_model.hpp"

namespace fringe_fusion::testing {

/// Where a ray meets an analytic object.
struct Hit {
  double range_m = 0.0;
  Eigen::Vector3d normal;
};
/// Nearest hit of the ray origin + t direction (unit), object frame.
using Scene = std::function<std::optional<Hit>(const Eigen::Vector3d& origin,
                                               const Eigen::Vector3d& direction)>;

inline Scene SphereScene(double radius_m) {
  return [radius_m](const Eigen::Vector3d& origin,
                    const Eigen::Vector3d& direction) -> std::optional<Hit> {
    const double along = -origin.dot(direction);
    const double miss2 = origin.squaredNorm() - along * along;
    if (!(miss2 < radius_m * radius_m)) return std::nullopt;
    const double range_m = along - std::sqrt(radius_m * radius_m - miss2);
    return Hit{range_m, (origin + range_m * direction).normalized()};
  };
}

/// Box around the origin with the given half sizes.
inline Scene BoxScene(const Eigen::Vector3d& half_m) {
  return [half_m](const Eigen::Vector3d& origin,
                  const Eigen::Vector3d& direction) -> std::optional<Hit> {
    double enter = -std::numeric_limits<double>::infinity();
    double leave = std::numeric_limits<double>::infinity();
    int axis = 0;
    for (int a = 0; a < 3; ++a) {
      const double to_center = -origin[a] / direction[a];
      const double half = std::abs(half_m[a] / direction[a]);
      if (to_center - half > enter) {
        enter = to_center - half;
        axis = a;
      }
      leave = std::min(leave, to_center + half);
    }
    if (!(enter < leave) || !(enter > 0.0)) return std::nullopt;
    const double sign = direction[axis] < 0.0 ? 1.0 : -1.0;
    return Hit{enter, sign * Eigen::Vector3d::Unit(axis)};
  };
}

struct ViewSettings {
  int width = 160;
  int height = 120;
  double focal_px = 300.0;
  double sigma_range_m = 0.0;  ///< of the noise that is added along the ray
  double stated_sigma_m = 5e-5;
  unsigned seed = 1;
};

/// Pose of a camera at `position` that looks at the origin (z forward, y down).
inline Transform LookAtOrigin(const Eigen::Vector3d& position) {
  const Eigen::Vector3d forward = -position.normalized();
  const Eigen::Vector3d up =
      std::abs(forward.z()) > 0.9 ? Eigen::Vector3d(0.0, 1.0, 0.0) : Eigen::Vector3d(0.0, 0.0, 1.0);
  const Eigen::Vector3d right = forward.cross(up).normalized();
  Transform T_object_camera = Transform::Identity();
  T_object_camera.linear().col(0) = right;
  T_object_camera.linear().col(1) = forward.cross(right);
  T_object_camera.linear().col(2) = forward;
  T_object_camera.translation() = position;
  return T_object_camera;
}

/// Range image of a scene by ray casting, with Gaussian noise along the rays and true normals.
inline View CastView(int id, const Scene& scene, const Eigen::Vector3d& position,
                     const ViewSettings& settings) {
  View view;
  view.id = id;
  view.name = "view " + std::to_string(id);
  view.pose.T_object_camera = LookAtOrigin(position);
  view.pose.source = PoseSource::kFile;
  view.range = MakeRangeImage(settings.width, settings.height);
  std::mt19937 random(settings.seed + static_cast<unsigned>(id) * 7919U);
  std::normal_distribution<double> noise(0.0, 1.0);
  const Eigen::Matrix3d R_object_camera = view.pose.T_object_camera.linear();
  for (int y = 0; y < settings.height; ++y) {
    for (int x = 0; x < settings.width; ++x) {
      const Eigen::Vector3d ray_camera =
          Eigen::Vector3d((x - 0.5 * (settings.width - 1)) / settings.focal_px,
                          (y - 0.5 * (settings.height - 1)) / settings.focal_px, 1.0)
              .normalized();
      const std::optional<Hit> hit = scene(position, R_object_camera * ray_camera);
      if (!hit) continue;
      const double range_m = hit->range_m + settings.sigma_range_m * noise(random);
      view.range.points(x, y) = (ray_camera * range_m).cast<float>();
      view.range.normals(x, y) = (R_object_camera.transpose() * hit->normal).cast<float>();
      const double stated =
          settings.sigma_range_m > 0.0 ? settings.sigma_range_m : settings.stated_sigma_m;
      view.range.sigma_range(x, y) = static_cast<float>(stated);
      view.range.sigma_lateral(x, y) = 0.0F;
      view.range.color(x, y) = Rgb8{200, 100, 50};
    }
  }
  return view;
}

/// Views from the corners and face centres of a cube: they see all of a convex object.
inline std::vector<View> CastAround(const Scene& scene, double distance_m,
                                    const ViewSettings& settings) {
  std::vector<View> views;
  for (int i = 0; i < 27; ++i) {
    const Eigen::Vector3d direction(i % 3 - 1, (i / 3) % 3 - 1, i / 9 - 1);
    const double length2 = direction.squaredNorm();
    if (length2 < 0.5 || (length2 > 1.5 && length2 < 2.5)) continue;
    views.push_back(CastView(static_cast<int>(views.size()), scene,
                             direction.normalized() * distance_m, settings));
  }
  return views;
}

/// Everything a model holds, for comparison byte for byte.
inline std::vector<std::uint32_t> Dump(const ImplicitModel& model) {
  std::vector<std::uint32_t> words;
  const auto add = [&](float value) {
    std::uint32_t word = 0;
    std::memcpy(&word, &value, sizeof(word));
    words.push_back(word);
  };
  for (const ImplicitModel::BlockIndex& block : model.Blocks()) {
    for (const int index : block) words.push_back(static_cast<std::uint32_t>(index));
    for (int i = 0; i < 512; ++i) {
      const FieldSample at =
          model.AtVoxel({block[0] * 8 + i % 8, block[1] * 8 + i / 8 % 8, block[2] * 8 + i / 64});
      words.push_back(at.supported ? 1U : 0U);
      if (!at.supported) continue;
      for (const float value : {at.distance, at.sigma, at.weight}) add(value);
      for (const float value : at.gradient) add(value);
      words.push_back(static_cast<std::uint32_t>(at.num_views));
      words.push_back(static_cast<std::uint32_t>(at.color.r << 16 | at.color.g << 8 | at.color.b));
    }
  }
  return words;
}

}  // namespace fringe_fusion::testing
