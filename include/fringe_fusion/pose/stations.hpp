#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/phase/phase_map.hpp"
#include "fringe_fusion/pose/relative_pose.hpp"
#include "fringe_fusion/pose/self_calibration.hpp"

namespace fringe_fusion {

/// Settings of the joint solution of several viewpoints. File: config/stations.yaml.
struct StationsConfig {
  int track_step_px = 8;       ///< grid of the anchor pixels that become tracks
  int fit_radius_px = 1;       ///< half window of the local fit that finds a code in an image
  double max_fit_sigma = 5.0;  ///< largest residual of that fit: beyond, an edge lies in it
  int min_tracks = 50;         ///< that a station must share with the others
  double huber_sigma = 2.5;    ///< residuals beyond count linearly
  int max_iterations = 50;
  double max_condition = 1e12;           ///< of the reduced system, scaled to unit diagonal
  double max_focal_sigma_ratio = 0.02;   ///< of focal lengths that are told
  double max_principal_sigma_px = 20.0;  ///< of principal points that are told
  double max_k1_sigma = 0.1;             ///< of distortion terms that are told

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("track_step_px", track_step_px, 1, 1000);
    field("fit_radius_px", fit_radius_px, 1, 10);
    field("max_fit_sigma", max_fit_sigma, 1.0, 1e6);
    field("min_tracks", min_tracks, 8, 1000000);
    field("huber_sigma", huber_sigma, 0.5, 1000.0);
    field("max_iterations", max_iterations, 1, 1000);
    field("max_condition", max_condition, 1.0, 1e18);
    field("max_focal_sigma_ratio", max_focal_sigma_ratio, 1e-6, 1.0);
    field("max_principal_sigma_px", max_principal_sigma_px, 1e-6, 1e4);
    field("max_k1_sigma", max_k1_sigma, 1e-6, 100.0);
  }
};

/// One sighting of a track.
struct TrackObservation {
  int track = 0;
  int station = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
};

/// Points that one resting device (the anchor) names by its exact pixels, seen from the stations
/// of a moving one. Projector at rest, camera moving: anchor = projector. Camera at rest, projector
/// moving: anchor = camera.
struct TrackSet {
  DevicePair devices;  ///< anchor at rest, observed moving
  int num_stations = 0;
  std::vector<Eigen::Vector2d> anchor_px;      ///< one per track
  std::vector<TrackObservation> observations;  ///< rising by track, then by station
};

/// Projector at rest: finds every `track_step_px`-th projector pixel in each camera image by
/// inverting the code map where it passes.
/// The map is fitted locally by an affine one; the covariance is that of the fit taken back to the
/// image, Sigma_c = G^-1 Sigma_p G^-T.
/// @param maps one phase map per camera station.
/// @return error when a map has the wrong size or codes one axis only.
/// Ref: science 3.5.
[[nodiscard]] Result<TrackSet> TracksOfProjector(const std::vector<PhaseMap>& maps,
                                                 const CellCalibration& nominal,
                                                 const StationsConfig& config);

/// Camera at rest: every `track_step_px`-th camera pixel is a track, its codes are the sightings.
[[nodiscard]] Result<TrackSet> TracksOfCamera(const std::vector<PhaseMap>& maps,
                                              const CellCalibration& nominal,
                                              const StationsConfig& config);

/// Joins track sets of single stations, which keep their order: equal anchor pixels are one track.
/// Large maps need not be in memory together.
/// @param parts made with the same devices and settings. @return error when there is none, or when
/// their devices differ in size.
[[nodiscard]] Result<TrackSet> MergeTracks(const std::vector<TrackSet>& parts);

/// Solution of all stations together.
struct StationsSolution {
  DevicePair devices;  ///< with the intrinsics found
  std::vector<Transform> T_station_anchor;
  /// Of the right perturbations; station 0 has none along its translation (the scale).
  std::vector<Matrix6d> covariance;
  /// Of everything: intrinsics as below, then the right perturbations; zero where held.
  Eigen::MatrixXd joint_covariance;
  std::vector<double> depth_m;  ///< per track, along z of the anchor; NaN: not determined
  /// Standard deviations: anchor log f, cx, cy, k1, then the same of the moving device; 0: held.
  Eigen::Matrix<double, 8, 1> sigma_intrinsics = Eigen::Matrix<double, 8, 1>::Zero();
  int num_tracks = 0;  ///< with at least one sighting
  int num_observations = 0;
  int iterations = 0;
  double rms_px = 0.0;        ///< of the inliers, per coordinate
  double reduced_chi2 = 0.0;  ///< of the inliers
  double condition = 0.0;
};

/// Solves all poses, all points and the free intrinsics in one go.
///
/// Start: a relative pose of each station with the anchor, relative scales from shared tracks
/// (median ratio of depths). Then bundle adjustment: a track has one unknown, its depth along the
/// exact anchor ray, so that its Schur complement is a scalar. Huber weights.
/// @param anchor, moving what is known of the intrinsics; all zero holds them.
/// @param baseline_m distance of station 0 from the anchor, which fixes the scale.
/// @return error for bad input, a station that shares too little with the others, a singular or
/// undetermined system (naming the weakest unknowns and the cure).
/// Ref: Triggs et al., "Bundle adjustment - a modern synthesis", 2000; science 3.5.
[[nodiscard]] Result<StationsSolution> SolveStations(
    const TrackSet& tracks, const IntrinsicsPrior& anchor, const IntrinsicsPrior& moving,
    double baseline_m, const EpipolarConfig& epipolar, const StationsConfig& config);

/// Poses and depths to start from. @return error naming the station.
struct StationsStart {
  std::vector<Transform> T_station_anchor;
  std::vector<double> depth_m;  ///< per track; NaN: none
};
[[nodiscard]] Result<StationsStart> StartStations(const TrackSet& tracks, double baseline_m,
                                                  const EpipolarConfig& epipolar,
                                                  const StationsConfig& config);

}  // namespace fringe_fusion
