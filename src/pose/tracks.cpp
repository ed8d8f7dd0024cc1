#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/pose/stations.hpp"

namespace fringe_fusion {
namespace {

constexpr int kGridRowsPerChunk = 8;

bool HasSize(const Image<float>& image, const CameraModel& camera) {
  return image.width() == camera.width && image.height() == camera.height;
}

Status CheckMaps(const std::vector<PhaseMap>& maps, const CameraModel& camera) {
  if (maps.empty()) return Fail("stations: no phase map");
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const PhaseMap& map = maps[i];
    if (map.u.empty() || map.v.empty()) {
      return Fail("stations: station {} codes only one axis; tracks need both", i);
    }
    if (!HasSize(map.u, camera) || !HasSize(map.v, camera) || !HasSize(map.sigma_u, camera) ||
        !HasSize(map.sigma_v, camera)) {
      return Fail("stations: the phase map of station {} is {} x {}, but the camera is {} x {}", i,
                  map.u.width(), map.u.height(), camera.width, camera.height);
    }
  }
  return {};
}

bool IsTrackable(const PhaseMap& map, int x, int y) {
  return map.u.Contains(x, y) && std::isfinite(map.u(x, y)) && std::isfinite(map.v(x, y)) &&
         map.sigma_u(x, y) > 0.0F && map.sigma_v(x, y) > 0.0F &&
         (map.mask.empty() || map.mask(x, y) == 0);
}

Eigen::Vector2d CodeAt(const PhaseMap& map, int x, int y) {
  return {static_cast<double>(map.u(x, y)), static_cast<double>(map.v(x, y))};
}

/// Weighted affine fit of one code component over a window: code = a . (1, dx, dy).
struct ComponentFit {
  Eigen::Vector3d a = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double max_residual_sigma = 0.0;
};

/// Finds where a code passes near a camera pixel.
class CodeInverter {
 public:
  CodeInverter(const PhaseMap& map, const StationsConfig& config) : map_(map), config_(config) {}

  /// @return camera pixel and covariance; nothing at an edge or where the code is not passed.
  [[nodiscard]] std::optional<TrackObservation> Find(const Eigen::Vector2d& code, int x,
                                                     int y) const {
    const std::optional<ComponentFit> u = Fit(map_.u, map_.sigma_u, x, y);
    const std::optional<ComponentFit> v = Fit(map_.v, map_.sigma_v, x, y);
    if (!u || !v) return std::nullopt;
    if (!(u->max_residual_sigma <= config_.max_fit_sigma) ||
        !(v->max_residual_sigma <= config_.max_fit_sigma)) {
      return std::nullopt;
    }
    Eigen::Matrix2d G;
    G << u->a[1], u->a[2], v->a[1], v->a[2];
    const Eigen::Matrix2d inverse = G.inverse();
    const Eigen::Vector2d offset = inverse * (code - Eigen::Vector2d(u->a[0], v->a[0]));
    // Beyond one pixel another window would be the right one.
    if (!inverse.allFinite() || !(offset.cwiseAbs().maxCoeff() <= 1.0)) return std::nullopt;
    const Eigen::Vector3d at(1.0, offset.x(), offset.y());
    const Eigen::Vector2d variance(at.dot(u->covariance * at), at.dot(v->covariance * at));
    TrackObservation out;
    out.pixel = Eigen::Vector2d(x, y) + offset;
    out.covariance_px2 = inverse * variance.asDiagonal() * inverse.transpose();
    return out;
  }

 private:
  /// Nothing when a pixel of the window is missing.
  [[nodiscard]] std::optional<ComponentFit> Fit(const Image<float>& values,
                                                const Image<float>& sigmas, int x, int y) const {
    const int r = config_.fit_radius_px;
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (int dy = -r; dy <= r; ++dy) {
      for (int dx = -r; dx <= r; ++dx) {
        if (!IsTrackable(map_, x + dx, y + dy)) return std::nullopt;
        const Eigen::Vector3d row(1.0, dx, dy);
        const double weight = std::pow(static_cast<double>(sigmas(x + dx, y + dy)), -2);
        normal += weight * row * row.transpose();
        right += weight * static_cast<double>(values(x + dx, y + dy)) * row;
      }
    }
    ComponentFit fit;
    fit.covariance = normal.inverse();
    fit.a = fit.covariance * right;
    for (int dy = -r; dy <= r; ++dy) {
      for (int dx = -r; dx <= r; ++dx) {
        const double e =
            static_cast<double>(values(x + dx, y + dy)) - fit.a.dot(Eigen::Vector3d(1.0, dx, dy));
        fit.max_residual_sigma = std::max(
            fit.max_residual_sigma, std::abs(e) / static_cast<double>(sigmas(x + dx, y + dy)));
      }
    }
    return fit;
  }

  const PhaseMap& map_;
  const StationsConfig& config_;
};

/// The camera pixel whose code comes closest to each grid point of the projector.
struct Nearest {
  int x = -1;
  int y = -1;
  double squared = std::numeric_limits<double>::infinity();
};

struct CodeGrid {
  int step = 1;
  int columns = 0;
  int rows = 0;

  CodeGrid(const CameraModel& device, int step_px)
      : step(step_px),
        columns((device.width + step_px - 1) / step_px),
        rows((device.height + step_px - 1) / step_px) {}
  [[nodiscard]] Eigen::Vector2d Code(int column, int row) const {
    const double half = 0.5 * (step - 1);
    return {column * step + std::floor(half), row * step + std::floor(half)};
  }
};

Image<Nearest> FindNearest(const PhaseMap& map, const CodeGrid& grid) {
  Image<Nearest> nearest(grid.columns, grid.rows);
  for (int y = 0; y < map.u.height(); ++y) {
    for (int x = 0; x < map.u.width(); ++x) {
      if (!IsTrackable(map, x, y)) continue;
      const Eigen::Vector2d code = CodeAt(map, x, y);
      const int column = static_cast<int>(std::floor(code.x() / grid.step));
      const int row = static_cast<int>(std::floor(code.y() / grid.step));
      if (!nearest.Contains(column, row)) continue;
      const double squared = (code - grid.Code(column, row)).squaredNorm();
      Nearest& best = nearest(column, row);
      if (squared < best.squared) best = {x, y, squared};
    }
  }
  return nearest;
}

/// Keeps tracks that are seen, and numbers them.
TrackSet Collect(const std::vector<Eigen::Vector2d>& candidates,
                 const std::vector<std::vector<TrackObservation>>& by_candidate) {
  TrackSet out;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (by_candidate[i].empty()) continue;
    const int track = static_cast<int>(out.anchor_px.size());
    out.anchor_px.push_back(candidates[i]);
    for (TrackObservation observation : by_candidate[i]) {
      observation.track = track;
      out.observations.push_back(observation);
    }
  }
  return out;
}

}  // namespace

Result<TrackSet> TracksOfProjector(const std::vector<PhaseMap>& maps,
                                   const CellCalibration& nominal, const StationsConfig& config) {
  if (Status status = CheckMaps(maps, nominal.camera); !status) return Forward(status);
  const CodeGrid grid(nominal.projector, config.track_step_px);
  std::vector<Eigen::Vector2d> codes;
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) codes.push_back(grid.Code(column, row));
  }
  std::vector<std::vector<TrackObservation>> found(codes.size());
  for (std::size_t station = 0; station < maps.size(); ++station) {
    const Image<Nearest> nearest = FindNearest(maps[station], grid);
    const CodeInverter inverter(maps[station], config);
    ParallelFor(grid.rows, kGridRowsPerChunk, [&](int begin, int end) {
      for (int row = begin; row < end; ++row) {
        for (int column = 0; column < grid.columns; ++column) {
          const Nearest& at = nearest(column, row);
          if (at.x < 0) continue;
          const auto i = static_cast<std::size_t>(row * grid.columns + column);
          std::optional<TrackObservation> seen = inverter.Find(codes[i], at.x, at.y);
          if (!seen) continue;
          seen->station = static_cast<int>(station);
          found[i].push_back(*seen);
        }
      }
    });
  }
  TrackSet tracks = Collect(codes, found);
  tracks.devices = {nominal.projector, nominal.camera};
  tracks.num_stations = static_cast<int>(maps.size());
  return tracks;
}

Result<TrackSet> TracksOfCamera(const std::vector<PhaseMap>& maps, const CellCalibration& nominal,
                                const StationsConfig& config) {
  if (Status status = CheckMaps(maps, nominal.camera); !status) return Forward(status);
  std::vector<Eigen::Vector2d> pixels;
  std::vector<std::vector<TrackObservation>> found;
  const int half = config.track_step_px / 2;
  for (int y = half; y < nominal.camera.height; y += config.track_step_px) {
    for (int x = half; x < nominal.camera.width; x += config.track_step_px) {
      pixels.emplace_back(x, y);
      found.emplace_back();
      for (std::size_t station = 0; station < maps.size(); ++station) {
        const PhaseMap& map = maps[station];
        if (!IsTrackable(map, x, y)) continue;
        TrackObservation seen;
        seen.station = static_cast<int>(station);
        seen.pixel = CodeAt(map, x, y);
        seen.covariance_px2(0, 0) = std::pow(static_cast<double>(map.sigma_u(x, y)), 2);
        seen.covariance_px2(1, 1) = std::pow(static_cast<double>(map.sigma_v(x, y)), 2);
        found.back().push_back(seen);
      }
    }
  }
  TrackSet tracks = Collect(pixels, found);
  tracks.devices = {nominal.camera, nominal.projector};
  tracks.num_stations = static_cast<int>(maps.size());
  return tracks;
}

Result<TrackSet> MergeTracks(const std::vector<TrackSet>& parts) {
  if (parts.empty()) return Fail("stations: no station");
  const DevicePair& devices = parts.front().devices;
  // By row, then column: the order of the grid that the tracks came from.
  std::map<std::pair<double, double>, std::vector<TrackObservation>> by_anchor;
  int num_stations = 0;
  for (const TrackSet& part : parts) {
    for (const auto& [ours, theirs] : {std::pair(devices.anchor, part.devices.anchor),
                                       std::pair(devices.observed, part.devices.observed)}) {
      if (ours.width == theirs.width && ours.height == theirs.height) continue;
      return Fail("stations: a device of station {} has {} x {} px, that of station 0 {} x {}",
                  num_stations, theirs.width, theirs.height, ours.width, ours.height);
    }
    for (TrackObservation seen : part.observations) {
      const Eigen::Vector2d& anchor = part.anchor_px[static_cast<std::size_t>(seen.track)];
      seen.station += num_stations;
      by_anchor[{anchor.y(), anchor.x()}].push_back(seen);
    }
    num_stations += part.num_stations;
  }
  std::vector<Eigen::Vector2d> anchors;
  std::vector<std::vector<TrackObservation>> observations;
  for (auto& [anchor, seen] : by_anchor) {
    anchors.emplace_back(anchor.second, anchor.first);
    observations.push_back(std::move(seen));
  }
  TrackSet merged = Collect(anchors, observations);
  merged.devices = devices;
  merged.num_stations = num_stations;
  return merged;
}

}  // namespace fringe_fusion
