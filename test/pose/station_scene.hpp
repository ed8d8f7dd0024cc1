#pragma once

#include <random>
#include <vector>

#include "fringe_fusion/pose/stations.hpp"
#include "test/pose/epipolar_scene.hpp"

namespace fringe_fusion::testing {

/// A projector at rest lights a relief; one camera sees it from several stations.
struct StationScene {
  DevicePair devices;  ///< anchor: projector, observed: camera
  std::vector<Transform> T_station_anchor;
};

/// Stations around the projector, each rolled by a further `roll_deg`.
inline StationScene MakeStationScene(int num_stations, double roll_deg) {
  StationScene scene;
  scene.devices.anchor = {1280, 800, 2400.0, 2400.0, 639.5, 399.5, {-0.05, 0.0, 0.0, 0.0, 0.0}};
  scene.devices.observed = {2448, 2048, 5600.0, 5600.0, 1223.5, 1023.5, {-0.1, 0.0, 0.0, 0.0, 0.0}};
  const std::vector<Eigen::Vector3d> centres{{-0.22, 0.01, 0.02}, {0.2, 0.05, 0.0},
                                             {0.03, -0.2, 0.01},  {-0.15, 0.18, -0.02},
                                             {0.18, -0.16, 0.03}, {-0.02, 0.24, 0.0}};
  for (int i = 0; i < num_stations; ++i) {
    Transform roll = Transform::Identity();
    roll.linear() = ExpRotation(Eigen::Vector3d(0.0, 0.0, i * roll_deg * M_PI / 180.0));
    scene.T_station_anchor.push_back(
        roll * LookFrom(centres[static_cast<std::size_t>(i)], {0.0, 0.0, 0.7}, {0.02, 0.01, 0.0}));
  }
  return scene;
}

/// Tracks on a grid of projector pixels, seen with Gaussian noise.
inline TrackSet MakeTracks(const StationScene& scene, int columns, int rows, double sigma_px,
                           unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> unit;
  const auto depth = Relief(0.035);
  TrackSet tracks;
  tracks.devices = scene.devices;
  tracks.num_stations = static_cast<int>(scene.T_station_anchor.size());
  const CameraModel& camera = scene.devices.observed;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const Eigen::Vector2d pixel((column + 0.5) * 1000.0 / columns + 140.0,
                                  (row + 0.5) * 760.0 / rows + 20.0);
      const Eigen::Vector2d ray = Undistort(scene.devices.anchor, pixel);
      const Eigen::Vector3d point = depth(ray) * ray.homogeneous();
      const int track = static_cast<int>(tracks.anchor_px.size());
      for (int station = 0; station < tracks.num_stations; ++station) {
        const Eigen::Vector2d seen =
            Project(camera, scene.T_station_anchor[static_cast<std::size_t>(station)] * point);
        if (!(seen.x() >= 0.0 && seen.y() >= 0.0 && seen.x() <= camera.width - 1.0 &&
              seen.y() <= camera.height - 1.0)) {
          continue;
        }
        tracks.observations.push_back(
            {track, station, seen + sigma_px * Eigen::Vector2d(unit(engine), unit(engine)),
             sigma_px * sigma_px * Eigen::Matrix2d::Identity()});
      }
      tracks.anchor_px.push_back(pixel);
    }
  }
  return tracks;
}

inline double BaselineOf(const StationScene& scene) {
  return scene.T_station_anchor.front().translation().norm();
}

}  // namespace fringe_fusion::testing
