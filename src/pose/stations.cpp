#include "fringe_fusion/pose/stations.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "bundle.hpp"
#include "common/dense.hpp"

namespace fringe_fusion {
namespace {

using epipolar::Bundle;
using epipolar::BundleState;
using epipolar::ReducedSystem;

constexpr std::array<const char*, 8> kIntrinsicNames{"focal length of the resting device",
                                                     "cx of the resting device",
                                                     "cy of the resting device",
                                                     "k1 of the resting device",
                                                     "focal length of the moving device",
                                                     "cx of the moving device",
                                                     "cy of the moving device",
                                                     "k1 of the moving device"};

std::string NameOf(Eigen::Index full_index) {
  if (full_index < 8) return kIntrinsicNames[static_cast<std::size_t>(full_index)];
  const Eigen::Index station = (full_index - 8) / 6;
  return fmt::format("{} of station {}", (full_index - 8) % 6 < 3 ? "rotation" : "position",
                     station);
}

Status CheckTracks(const TrackSet& tracks) {
  int last_track = 0;
  for (std::size_t i = 0; i < tracks.observations.size(); ++i) {
    const TrackObservation& seen = tracks.observations[i];
    const bool known = seen.track >= last_track && seen.station >= 0 &&
                       static_cast<std::size_t>(seen.track) < tracks.anchor_px.size() &&
                       seen.station < tracks.num_stations;
    if (!known) {
      return Fail(
          "stations: sighting {} names track {} and station {} of {} and {}, or is not in "
          "rising order",
          i, seen.track, seen.station, tracks.anchor_px.size(), tracks.num_stations);
    }
    last_track = seen.track;
    if (!seen.pixel.allFinite() || !seen.covariance_px2.allFinite() ||
        !(seen.covariance_px2(0, 0) > 0.0) || !(seen.covariance_px2.determinant() > 0.0)) {
      return Fail("stations: sighting {} of track {} has the pixel ({}, {}) and variance {}", i,
                  seen.track, seen.pixel.x(), seen.pixel.y(), seen.covariance_px2(0, 0));
    }
  }
  if (tracks.num_stations < 1) return Fail("stations: no station");
  return {};
}

Status CheckSettings(const TrackSet& tracks, const IntrinsicsPrior& anchor,
                     const IntrinsicsPrior& moving, double baseline_m,
                     const StationsConfig& config) {
  if (Status status = CheckBounds(config, "stations"); !status) return status;
  if (Status status = Validate(tracks.devices.anchor, "stations: anchor"); !status) return status;
  if (Status status = Validate(tracks.devices.observed, "stations: moving device"); !status) {
    return status;
  }
  for (const IntrinsicsPrior& prior : {anchor, moving}) {
    if (!(prior.focal_ratio >= 0.0) || !(prior.principal_px >= 0.0) || !(prior.k1 >= 0.0)) {
      return Fail("stations: a prior sigma is negative: focal {}, principal point {}, k1 {}",
                  prior.focal_ratio, prior.principal_px, prior.k1);
    }
  }
  if (!(baseline_m > 0.0) || !std::isfinite(baseline_m)) {
    return Fail("stations: baseline {} m must be positive", baseline_m);
  }
  return CheckTracks(tracks);
}

bool IsHeld(const IntrinsicsPrior& prior) {
  return prior.focal_ratio == 0.0 && prior.principal_px == 0.0 && prior.k1 == 0.0;
}

/// Poses first, then everything that is free, with the robust scale of the poses.
Status Descend(Bundle& bundle, BundleState& state, const StationsConfig& config,
               StationsSolution& solution) {
  // First without sightings that are far off at the start: together they would pull it away.
  for (const double reject_sigma : {20.0, 5.0}) {
    bundle.SetScale(bundle.RobustScale(state));
    bundle.SetRejection(reject_sigma);
    const int iterations = bundle.Solve(state, config.max_iterations);
    if (iterations < 0) {
      return Fail(
          "stations: the joint system has no finite solution: the stations or intrinsics "
          "are not determined; roll the camera, use at least 4 stations and relief");
    }
    solution.iterations += iterations;
  }
  return {};
}

/// Condition and the name of what is determined worst.
struct Weakness {
  double condition = kFree;
  std::string name;
};

Weakness FindWeakness(const Eigen::MatrixXd& hessian, const Eigen::MatrixXd& basis) {
  Weakness out;
  const Eigen::VectorXd scale = hessian.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * hessian * scale.asDiagonal();
  if (!scaled.allFinite()) {
    out.name = "an unknown without any sighting";
    return out;
  }
  const dense::SymmetricEigen eigen = dense::DecomposeSymmetric(scaled);
  Eigen::Index worst = 0;
  eigen.vectors.col(0).cwiseAbs().maxCoeff(&worst);
  Eigen::Index full = 0;
  basis.col(worst).cwiseAbs().maxCoeff(&full);
  out.name = NameOf(full);
  if (eigen.values[0] > 0.0) out.condition = eigen.values[scaled.rows() - 1] / eigen.values[0];
  return out;
}

Status JudgeIntrinsics(const StationsSolution& solution, const StationsConfig& config) {
  const std::array<double, 4> limits{config.max_focal_sigma_ratio, config.max_principal_sigma_px,
                                     config.max_principal_sigma_px, config.max_k1_sigma};
  for (Eigen::Index k = 0; k < 8; ++k) {
    const double limit = limits[static_cast<std::size_t>(k % 4)];
    // Negated so that NaN fails.
    if (!(solution.sigma_intrinsics[k] <= limit)) {
      return Fail(
          "stations: the {} is not determined (sigma {:.3g}, limit {:.3g}): roll the "
          "camera by 90 deg between stations, use at least 4 stations and relief, or give "
          "a prior",
          kIntrinsicNames[static_cast<std::size_t>(k)], solution.sigma_intrinsics[k], limit);
    }
  }
  return {};
}

Status Conclude(const Bundle& bundle, const BundleState& state, const StationsConfig& config,
                StationsSolution& solution) {
  const ReducedSystem system = bundle.Reduce(state, 0.0);
  const Eigen::MatrixXd basis = bundle.FreeBasis(state);
  const Eigen::MatrixXd hessian = dense::Propagate(basis.transpose(), system.hessian);
  const Weakness weakness = FindWeakness(hessian, basis);
  solution.condition = weakness.condition;
  if (!(weakness.condition <= config.max_condition)) {
    return Fail(
        "stations: the layout is singular (condition {:.2g}, limit {:.2g}), weakest: {}; "
        "roll the camera by 90 deg between stations, use at least 4 stations and relief",
        weakness.condition, config.max_condition, weakness.name);
  }
  const int dof = 2 * system.num_inliers - system.num_tracks - static_cast<int>(hessian.rows());
  solution.reduced_chi2 = system.chi2 / std::max(1, dof);
  solution.joint_covariance =
      std::max(1.0, solution.reduced_chi2) * dense::Propagate(basis, dense::Invert(hessian));
  solution.devices = state.devices;
  solution.T_station_anchor = state.T_station_anchor;
  solution.depth_m = state.depth_m;
  solution.num_tracks = system.num_tracks;
  solution.rms_px = std::sqrt(system.sum_px2 / std::max(1, 2 * system.num_inliers));
  const Eigen::MatrixXd& covariance = solution.joint_covariance;
  solution.sigma_intrinsics = covariance.diagonal().head<8>().cwiseSqrt();
  for (std::size_t i = 0; i < state.T_station_anchor.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(8 + 6 * i);
    solution.covariance.emplace_back(covariance.block<6, 6>(at, at));
  }
  return JudgeIntrinsics(solution, config);
}

}  // namespace

Result<StationsSolution> SolveStations(const TrackSet& tracks, const IntrinsicsPrior& anchor,
                                       const IntrinsicsPrior& moving, double baseline_m,
                                       const EpipolarConfig& epipolar,
                                       const StationsConfig& config) {
  if (Status status = CheckSettings(tracks, anchor, moving, baseline_m, config); !status) {
    return Forward(status);
  }
  Result<StationsStart> start = StartStations(tracks, baseline_m, epipolar, config);
  if (!start) return Forward(start);
  BundleState state{tracks.devices, std::move(start->T_station_anchor), std::move(start->depth_m)};
  StationsSolution solution;
  solution.num_observations = static_cast<int>(tracks.observations.size());
  if (!IsHeld(anchor) || !IsHeld(moving)) {
    Bundle poses(tracks, {}, {}, tracks.devices, config.huber_sigma);
    if (Status status = Descend(poses, state, config, solution); !status) return Forward(status);
  }
  Bundle bundle(tracks, anchor, moving, tracks.devices, config.huber_sigma);
  if (Status status = Descend(bundle, state, config, solution); !status) return Forward(status);
  if (Status status = Conclude(bundle, state, config, solution); !status) return Forward(status);
  return solution;
}

}  // namespace fringe_fusion
