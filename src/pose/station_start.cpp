#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "epipolar_solver.hpp"
#include "fringe_fusion/pose/stations.hpp"

namespace fringe_fusion {
namespace {

constexpr double kRejectSigma = 5.0;

/// One station by itself: pose with unit baseline, depths of its tracks in that unit; sightings
/// that miss their epipolar line have none.
struct SoloStation {
  Transform T_station_anchor = Transform::Identity();
  std::map<int, double> depth;  ///< by track
};

Result<SoloStation> SolveAlone(const TrackSet& tracks, int station,
                               const EpipolarConfig& epipolar) {
  std::vector<Match> matches;
  std::vector<int> ids;
  for (const TrackObservation& seen : tracks.observations) {
    if (seen.station != station) continue;
    matches.push_back(
        {tracks.anchor_px[static_cast<std::size_t>(seen.track)], seen.pixel, seen.covariance_px2});
    ids.push_back(seen.track);
  }
  // A start only: a plane's second pose is left to the joint solution.
  EpipolarConfig loose = epipolar;
  loose.max_direction_sigma_deg = 90.0;
  const auto pose = EstimateRelativePose(matches, tracks.devices, loose);
  if (!pose) return Fail("stations: station {}: {}", station, pose.error().message);
  SoloStation solo;
  solo.T_station_anchor = pose->T_observed_anchor;
  const epipolar::Geometry geometry{solo.T_station_anchor.linear(),
                                    solo.T_station_anchor.translation()};
  std::vector<epipolar::Ray> rays;
  for (const Match& match : matches) rays.push_back(epipolar::MakeRay(match, tracks.devices));
  const Eigen::Matrix3d essential = geometry.Essential();
  const double limit = kRejectSigma * epipolar::RobustScale(rays, essential);
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const epipolar::Ray& ray = rays[i];
    if (!(std::abs(epipolar::Residual(ray, essential)) <= limit)) continue;
    const double depth = epipolar::Depths(ray, geometry)[0];
    if (depth > 0.0 && std::isfinite(depth)) solo.depth[ids[i]] = depth;
  }
  return solo;
}

/// Median ratio of the depths of shared tracks: length of the baseline of `b` in that of `a`.
struct ScaleTie {
  int shared = 0;
  double ratio = 0.0;
};

ScaleTie Compare(const SoloStation& a, const SoloStation& b) {
  std::vector<double> ratios;
  for (const auto& [track, depth] : a.depth) {
    const auto other = b.depth.find(track);
    if (other != b.depth.end()) ratios.push_back(depth / other->second);
  }
  ScaleTie tie;
  tie.shared = static_cast<int>(ratios.size());
  tie.ratio = epipolar::MedianInPlace(ratios);
  return tie;
}

/// Scales all stations to station 0, always along the strongest tie that is left.
Result<std::vector<double>> ChainScales(const std::vector<SoloStation>& solo, int min_tracks) {
  std::vector<double> scale(solo.size(), 0.0);
  scale[0] = 1.0;
  for (std::size_t done = 1; done < solo.size(); ++done) {
    ScaleTie best;
    std::size_t best_to = 0;
    double from_scale = 0.0;
    for (std::size_t from = 0; from < solo.size(); ++from) {
      if (scale[from] == 0.0) continue;
      for (std::size_t to = 0; to < solo.size(); ++to) {
        if (scale[to] != 0.0) continue;
        const ScaleTie tie = Compare(solo[from], solo[to]);
        if (best_to != 0 && tie.shared <= best.shared) continue;
        best = tie;
        best_to = to;
        from_scale = scale[from];
      }
    }
    if (best.shared < min_tracks || !(best.ratio > 0.0)) {
      return Fail("stations: station {} shares {} tracks with the others, at least {} are needed",
                  best_to, best.shared, min_tracks);
    }
    scale[best_to] = from_scale * best.ratio;
  }
  return scale;
}

/// Of the depths that single stations give a track, the one that most sightings agree with: a code
/// that is false along the epipolar line shows in no station by itself.
std::vector<double> ChooseDepths(const TrackSet& tracks,
                                 const std::vector<Transform>& T_station_anchor,
                                 const std::vector<std::vector<double>>& candidates) {
  constexpr double kFarPx = 5.0;  // a start is off by pixels where the focal lengths are
  std::vector<double> chosen(candidates.size(), std::numeric_limits<double>::quiet_NaN());
  std::size_t first = 0;
  for (std::size_t track = 0; track < candidates.size(); ++track) {
    std::size_t end = first;
    while (end < tracks.observations.size() &&
           tracks.observations[end].track == static_cast<int>(track)) {
      ++end;
    }
    const Eigen::Vector3d ray =
        Undistort(tracks.devices.anchor, tracks.anchor_px[track]).homogeneous();
    double best = std::numeric_limits<double>::infinity();
    for (const double depth : candidates[track]) {
      double cost = 0.0;
      for (std::size_t k = first; k < end; ++k) {
        const TrackObservation& seen = tracks.observations[k];
        const Eigen::Vector3d point =
            T_station_anchor[static_cast<std::size_t>(seen.station)] * (depth * ray);
        const double distance = (Project(tracks.devices.observed, point) - seen.pixel).norm();
        // Not finite behind a device: such a depth is none.
        cost += std::isfinite(distance) ? std::min(distance, kFarPx) : 1e6;
      }
      if (cost < best && cost < 1e6) {
        best = cost;
        chosen[track] = depth;
      }
    }
    first = end;
  }
  return chosen;
}

}  // namespace

Result<StationsStart> StartStations(const TrackSet& tracks, double baseline_m,
                                    const EpipolarConfig& epipolar, const StationsConfig& config) {
  std::vector<SoloStation> solo;
  for (int station = 0; station < tracks.num_stations; ++station) {
    Result<SoloStation> one = SolveAlone(tracks, station, epipolar);
    if (!one) return Forward(one);
    solo.push_back(std::move(*one));
  }
  if (solo.empty()) return Fail("stations: no station");
  const Result<std::vector<double>> scales = ChainScales(solo, config.min_tracks);
  if (!scales) return Forward(scales);
  StationsStart start;
  std::vector<std::vector<double>> candidates(tracks.anchor_px.size());
  for (std::size_t i = 0; i < solo.size(); ++i) {
    const double scale_m = baseline_m * (*scales)[i];
    Transform T = solo[i].T_station_anchor;
    T.translation() *= scale_m;
    start.T_station_anchor.push_back(T);
    for (const auto& [track, depth] : solo[i].depth) {
      candidates[static_cast<std::size_t>(track)].push_back(scale_m * depth);
    }
  }
  start.depth_m = ChooseDepths(tracks, start.T_station_anchor, candidates);
  return start;
}

}  // namespace fringe_fusion
