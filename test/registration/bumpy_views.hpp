#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <random>
#include <vector>

#include "fringe_fusion/registration/register_views.hpp"

namespace fringe_fusion::testing {

constexpr double kRadPerDeg = M_PI / 180.0;

/// For views of a few thousand points.
inline RegistrationConfig SmallConfig() {
  RegistrationConfig config;
  config.min_correspondences = 60;
  return config;
}

/// Views of a star-shaped bumpy body, r = R(direction), with known poses.
struct BumpyScene {
  double radius_m = 0.04;
  double bump_ratio = 0.08;  ///< amplitude of the bumps over the radius
  int num_views = 6;         ///< evenly on a circle around z
  int width = 96;
  int height = 80;
  double distance_m = 0.4;           ///< camera to centre
  double elevation_step_rad = 0.25;  ///< of every second view; 0: a turntable about z
  double sigma_range_m = 2e-5;
  double sigma_normal_rad = 0.01;
  double sigma_prior_rotation_rad = 0.05 * M_PI / 180.0;
  double sigma_prior_translation_m = 0.2e-3;
  unsigned seed = 1;
};

inline double BumpyRadius(const BumpyScene& scene, const Eigen::Vector3d& d) {
  const double bumps = std::sin(5.0 * d.x() + 1.0) * std::cos(6.0 * d.y()) +
                       0.7 * std::sin(7.0 * d.z() + 2.0 * d.x());
  return scene.radius_m * (1.0 + scene.bump_ratio * bumps);
}

/// Signed value whose zero is the surface; positive outside.
inline double BumpyValue(const BumpyScene& scene, const Eigen::Vector3d& point) {
  return point.norm() - BumpyRadius(scene, point.normalized());
}

inline Eigen::Vector3d BumpyNormal(const BumpyScene& scene, const Eigen::Vector3d& point) {
  constexpr double kStep = 1e-6;
  Eigen::Vector3d gradient;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d offset = kStep * Eigen::Vector3d::Unit(axis);
    gradient[axis] = BumpyValue(scene, point + offset) - BumpyValue(scene, point - offset);
  }
  return gradient.normalized();
}

/// Camera on a circle, looking at the centre from slightly above; optical frame.
inline Transform TurntablePose(double angle_rad, double elevation_rad, double distance_m) {
  const Eigen::Vector3d position =
      distance_m * Eigen::Vector3d(std::cos(angle_rad) * std::cos(elevation_rad),
                                   std::sin(angle_rad) * std::cos(elevation_rad),
                                   std::sin(elevation_rad));
  const Eigen::Vector3d z = -position.normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Transform T_object_camera = Transform::Identity();
  T_object_camera.linear().col(0) = x;
  T_object_camera.linear().col(1) = z.cross(x);
  T_object_camera.linear().col(2) = z;
  T_object_camera.translation() = position;
  return T_object_camera;
}

inline Vector6d RandomTwist(double sigma_rotation_rad, double sigma_translation_m,
                            std::mt19937& random) {
  std::normal_distribution<double> gauss;
  Vector6d xi;
  for (int i = 0; i < 3; ++i) xi[i] = sigma_rotation_rad * gauss(random);
  for (int i = 3; i < 6; ++i) xi[i] = sigma_translation_m * gauss(random);
  return xi;
}

/// Range image of the body from a true pose, with noise along the rays and on the normals.
inline RangeImage RenderBumpy(const BumpyScene& scene, const Transform& T_object_camera,
                              std::mt19937& random) {
  std::normal_distribution<double> gauss;
  RangeImage range = MakeRangeImage(scene.width, scene.height);
  const double focal_px = 0.42 * scene.height * scene.distance_m / scene.radius_m;
  for (int y = 0; y < scene.height; ++y) {
    for (int x = 0; x < scene.width; ++x) {
      const Eigen::Vector3d ray = Eigen::Vector3d((x - 0.5 * scene.width) / focal_px,
                                                  (y - 0.5 * scene.height) / focal_px, 1.0)
                                      .normalized();
      double t = scene.distance_m - 1.4 * scene.radius_m;
      double value = 1.0;
      for (int step = 0; step < 200 && std::abs(value) > 1e-10 && t < 2.0; ++step) {
        value = BumpyValue(scene, T_object_camera * (t * ray));
        t += 0.7 * value;
      }
      if (!(std::abs(value) <= 1e-10)) continue;
      Eigen::Vector3d normal =
          T_object_camera.linear().transpose() * BumpyNormal(scene, T_object_camera * (t * ray));
      if (!(normal.dot(-ray) > 0.2)) continue;
      t += scene.sigma_range_m * gauss(random);
      const Vector6d tilt = RandomTwist(scene.sigma_normal_rad, 0.0, random);
      normal = ExpRotation(tilt.head<3>()) * normal;
      range.points(x, y) = (t * ray).cast<float>();
      range.normals(x, y) = normal.cast<float>().normalized();
      if (scene.sigma_range_m > 0.0) {
        range.sigma_range(x, y) = static_cast<float>(scene.sigma_range_m);
        range.sigma_lateral(x, y) = static_cast<float>(0.1 * scene.sigma_range_m);
      }
    }
  }
  return range;
}

/// A graph whose priors are the true poses times Exp of a random twist.
struct BumpyGraph {
  ViewGraph graph;
  std::vector<Transform> T_object_camera_true;
};

inline BumpyGraph MakeBumpyGraph(const BumpyScene& scene) {
  std::mt19937 random(scene.seed);
  BumpyGraph out;
  for (int i = 0; i < scene.num_views; ++i) {
    const double elevation = 0.2 + scene.elevation_step_rad * (i % 2);
    const Transform T =
        TurntablePose(2.0 * M_PI * i / scene.num_views, elevation, scene.distance_m);
    View view;
    view.id = i;
    view.name = std::to_string(i);
    view.range = RenderBumpy(scene, T, random);
    view.pose.T_object_camera = T * Exp(RandomTwist(scene.sigma_prior_rotation_rad,
                                                    scene.sigma_prior_translation_m, random));
    view.pose.covariance =
        PoseCovariance(scene.sigma_prior_rotation_rad, scene.sigma_prior_translation_m);
    view.pose.source = PoseSource::kTf;
    out.graph.views.push_back(std::move(view));
    out.T_object_camera_true.push_back(T);
  }
  return out;
}

inline std::vector<Transform> PosesOf(const RegistrationResult& result) {
  std::vector<Transform> poses;
  for (const RegisteredView& view : result.views) poses.push_back(view.pose.T_object_camera);
  return poses;
}

inline std::vector<Transform> PosesOf(const ViewGraph& graph) {
  std::vector<Transform> poses;
  for (const View& view : graph.views) poses.push_back(view.pose.T_object_camera);
  return poses;
}

}  // namespace fringe_fusion::testing
