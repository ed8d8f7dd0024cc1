#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "epipolar_solver.hpp"
#include "fringe_fusion/pose/stations.hpp"

namespace fringe_fusion {
namespace {

/// One station by itself: pose with unit baseline, depths of its tracks in that unit.
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
  for (std::size_t i = 0; i < matches.size(); ++i) {
    epipolar::Ray ray;
    ray.anchor = Undistort(tracks.devices.anchor, matches[i].anchor_px);
    ray.observed = Undistort(tracks.devices.observed, matches[i].observed_px);
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
  std::vector<std::vector<double>> depths(tracks.anchor_px.size());
  for (std::size_t i = 0; i < solo.size(); ++i) {
    const double scale_m = baseline_m * (*scales)[i];
    Transform T = solo[i].T_station_anchor;
    T.translation() *= scale_m;
    start.T_station_anchor.push_back(T);
    for (const auto& [track, depth] : solo[i].depth) {
      depths[static_cast<std::size_t>(track)].push_back(scale_m * depth);
    }
  }
  for (std::vector<double>& depth : depths) {
    start.depth_m.push_back(epipolar::MedianInPlace(depth));
  }
  return start;
}

}  // namespace fringe_fusion
