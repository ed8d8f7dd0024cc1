#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "cell_data.hpp"

namespace fringe_fusion::bundle {
namespace {

constexpr std::array<const char*, 2> kDeviceNames = {"camera", "projector"};
/// Lens distortion bends a target by a few per cent; wrong point numbers tear it.
constexpr double kMaxBendRatio = 0.05;

Result<Eigen::Matrix2d> Whitener(const Eigen::Matrix2d& covariance, const std::string& owner) {
  const Eigen::LLT<Eigen::Matrix2d> factor(covariance);
  if (!covariance.allFinite() || factor.info() != Eigen::Success) {
    return Fail("{}: the covariance [{} {}; {} {}] px^2 is not positive definite", owner,
                covariance(0, 0), covariance(0, 1), covariance(1, 0), covariance(1, 1));
  }
  return Eigen::Matrix2d(Eigen::Matrix2d(factor.matrixL()).inverse());
}

Status AddObservation(const CalibrationTarget& target, const TargetSighting& sighting,
                      const PointSighting& seen, std::size_t device,
                      const CalibrationConfig& config, Station& station) {
  Observation observation;
  observation.point = seen.point;
  observation.pixel = device == kCamera ? seen.pixel_camera : seen.pixel_projector;
  const std::string owner =
      fmt::format("{}: point {}: {}", sighting.name, seen.point, kDeviceNames[device]);
  if (!observation.pixel.allFinite()) return Fail("{}: the pixel is not finite", owner);
  if (!config.equal_weights) {
    const auto whitener = Whitener(
        device == kCamera ? seen.covariance_camera_px2 : seen.covariance_projector_px2, owner);
    if (!whitener) return Fail("{}", whitener.error().message);
    observation.whitener = *whitener;
  }
  if (device == kCamera && sighting.is_ellipse_centre) {
    observation.dot_radius_m = DotRadius(target, seen.point);
  }
  station.seen[device].push_back(observation);
  return {};
}

Result<Station> ReadSighting(const CalibrationTarget& target, const TargetSighting& sighting,
                             const CalibrationConfig& config) {
  Station station;
  std::set<int> known;
  for (const PointSighting& seen : sighting.points) {
    if (seen.point < 0 || seen.point >= target.num_columns * target.num_rows) {
      return Fail("{}: point {}: the target has points 0 to {}", sighting.name, seen.point,
                  target.num_columns * target.num_rows - 1);
    }
    if (!known.insert(seen.point).second) {
      return Fail("{}: point {} occurs twice", sighting.name, seen.point);
    }
    if (Status s = AddObservation(target, sighting, seen, kCamera, config, station); !s) {
      return tl::unexpected<Error>(s.error());
    }
    if (!seen.has_projector) continue;
    if (Status s = AddObservation(target, sighting, seen, kProjector, config, station); !s) {
      return tl::unexpected<Error>(s.error());
    }
  }
  return station;
}

PlanarView ViewOf(const std::vector<Observation>& seen,
                  const std::vector<Eigen::Vector3d>& points) {
  PlanarView view;
  for (const Observation& observation : seen) {
    view.plane_m.emplace_back(points[static_cast<std::size_t>(observation.point)].head<2>());
    view.pixel.push_back(observation.pixel);
  }
  return view;
}

double ExtentPx(const std::vector<Observation>& seen) {
  Eigen::Vector2d low = seen.front().pixel;
  Eigen::Vector2d high = low;
  for (const Observation& observation : seen) {
    low = low.cwiseMin(observation.pixel);
    high = high.cwiseMax(observation.pixel);
  }
  return (high - low).norm();
}

/// Positions of the points if their numbers ran with rows and columns exchanged.
std::vector<Eigen::Vector3d> SwappedPoints(const CalibrationTarget& target) {
  CalibrationTarget swapped = target;
  std::swap(swapped.num_columns, swapped.num_rows);
  return TargetPoints(swapped);
}

/// Fits one sighting; fills reason and homographies.
void ScreenStation(std::size_t index, const CalibrationConfig& config, CellData& data) {
  Station& station = data.stations[index];
  std::string& reason = data.reasons[index];
  for (const std::size_t device : {kCamera, kProjector}) {
    std::vector<Observation>& seen = station.seen[device];
    const auto num_points = static_cast<int>(seen.size());
    if (num_points < config.min_points) {
      if (device == kCamera) {
        reason =
            fmt::format("{} points in the camera, {} are needed", num_points, config.min_points);
        break;
      }
      seen.clear();
      continue;
    }
    const auto fit = FitHomography(ViewOf(seen, data.points));
    const double bend = fit ? fit->median_residual_px / ExtentPx(seen) : 1.0;
    if (!(bend <= kMaxBendRatio)) {
      reason = fmt::format(
          "the points do not lie on the target: median {:.1f} px from a plane in the {}",
          fit ? fit->median_residual_px : 0.0, kDeviceNames[device]);
      break;
    }
    if (fit->mirrored) {
      reason = fmt::format("mirrored in the {}", kDeviceNames[device]);
      break;
    }
    data.homographies[device][index] = fit;
  }
  if (!reason.empty()) station.seen = {};
}

/// Faults that every sighting shares are faults of the target or the set-up, not of a picture.
Status CheckCommonFaults(const CalibrationTarget& target,
                         const std::vector<TargetSighting>& sightings, const CellData& data,
                         const std::vector<Station>& before) {
  std::size_t num_refused = 0;
  std::size_t num_mirrored = 0;
  std::size_t num_swapped = 0;
  const std::vector<Eigen::Vector3d> swapped = SwappedPoints(target);
  for (std::size_t i = 0; i < data.reasons.size(); ++i) {
    if (data.reasons[i].empty()) continue;
    ++num_refused;
    if (data.reasons[i].rfind("mirrored", 0) == 0) ++num_mirrored;
    const std::vector<Observation>& seen = before[i].seen[kCamera];
    if (target.num_columns == target.num_rows || seen.size() < 8) continue;
    const auto fit = FitHomography(ViewOf(seen, swapped));
    if (fit && fit->median_residual_px < 0.5 * kMaxBendRatio * ExtentPx(seen)) ++num_swapped;
  }
  const std::size_t half = sightings.size() / 2;
  if (num_mirrored > half) {
    return Fail(
        "{} of {} sightings are mirrored, e.g. {}: {}: is the print or the image mirrored, "
        "or does the pattern run the wrong way?",
        num_mirrored, sightings.size(), sightings.front().name, data.reasons.front());
  }
  if (num_swapped > half && num_refused > half) {
    return Fail(
        "the point numbers fit {} columns x {} rows, not {} x {}: are rows and columns of "
        "the target swapped?",
        target.num_rows, target.num_columns, target.num_columns, target.num_rows);
  }
  return {};
}

/// One block per sighting off a stage, one per stage group.
void AssignBlocks(const std::vector<StageStation>& stage, CellData& data) {
  std::map<int, std::size_t> group_block;
  for (std::size_t i = 0; i < data.stations.size(); ++i) {
    Station& station = data.stations[i];
    const int group = stage.empty() ? -1 : stage[i].group;
    const auto known = group < 0 ? group_block.end() : group_block.find(group);
    if (known != group_block.end()) {
      station.block = known->second;
    } else {
      station.block = data.nominal_shifts.size();
      data.nominal_shifts.emplace_back();
      data.first_station.push_back(i);
      if (group >= 0) group_block[group] = station.block;
    }
    if (group < 0) continue;
    station.shift = static_cast<int>(data.nominal_shifts[station.block].size());
    data.nominal_shifts[station.block].push_back(stage[i].shift_m);
  }
}

}  // namespace

Result<CellData> ScreenSightings(const CalibrationTarget& target,
                                 const std::vector<TargetSighting>& sightings,
                                 const std::vector<StageStation>& stage,
                                 const CalibrationConfig& config) {
  if (Status s = Validate(target, "target"); !s) return tl::unexpected<Error>(s.error());
  if (!stage.empty() && stage.size() != sightings.size()) {
    return Fail("{} stage displacements for {} sightings", stage.size(), sightings.size());
  }
  CellData data;
  data.points = TargetPoints(target);
  for (const TargetSighting& sighting : sightings) {
    auto station = ReadSighting(target, sighting, config);
    if (!station) return Forward(station);
    data.stations.push_back(std::move(*station));
  }
  const std::size_t num = sightings.size();
  data.reasons.resize(num);
  for (auto& homographies : data.homographies) homographies.resize(num);
  const std::vector<Station> before = data.stations;
  for (std::size_t i = 0; i < num; ++i) ScreenStation(i, config, data);
  if (Status s = CheckCommonFaults(target, sightings, data, before); !s) {
    return tl::unexpected<Error>(s.error());
  }
  AssignBlocks(stage, data);
  return data;
}

}  // namespace fringe_fusion::bundle
