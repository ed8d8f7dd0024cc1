#include "fringe_fusion/calibration/cell_session.hpp"

#include <algorithm>

#include "coverage_grid.hpp"

namespace fringe_fusion {

Coverage CoverageOf(const std::vector<TargetSighting>& sightings, const DeviceSizes& sizes,
                    double min_ratio) {
  CoverageGrid camera(sizes.camera_width, sizes.camera_height);
  CoverageGrid projector(sizes.projector_width, sizes.projector_height);
  for (const TargetSighting& sighting : sightings) {
    for (const PointSighting& point : sighting.points) {
      camera.Add(point.pixel_camera);
      if (point.has_projector) projector.Add(point.pixel_projector);
    }
  }
  Coverage coverage;
  coverage.camera_ratio = camera.Ratio();
  coverage.projector_ratio = projector.Ratio();
  if (coverage.camera_ratio < min_ratio) coverage.gaps = camera.EmptyQuarters("camera");
  if (coverage.projector_ratio < min_ratio) {
    const std::string gaps = projector.EmptyQuarters("projector");
    if (!gaps.empty() && !coverage.gaps.empty()) coverage.gaps += "; ";
    coverage.gaps += gaps;
  }
  return coverage;
}

Status CellSession::Add(TargetSighting sighting) {
  for (const TargetSighting& known : sightings_) {
    if (known.name == sighting.name) return Fail("there is a pose '{}' already", known.name);
  }
  sightings_.push_back(std::move(sighting));
  solution_.reset();
  return {};
}

Status CellSession::Remove(const std::string& name) {
  if (sightings_.empty()) return Fail("there is no pose to remove");
  auto found = sightings_.end() - 1;
  if (!name.empty()) {
    found = std::find_if(sightings_.begin(), sightings_.end(),
                         [&name](const TargetSighting& known) { return known.name == name; });
  }
  if (found == sightings_.end()) {
    std::vector<std::string> names;
    for (const TargetSighting& known : sightings_) names.push_back(known.name);
    return Fail("there is no pose '{}' among {}", name, fmt::join(names, ", "));
  }
  sightings_.erase(found);
  solution_.reset();
  return {};
}

void CellSession::Clear() {
  sightings_.clear();
  solution_.reset();
}

const Result<CellCalibrationResult>& CellSession::Solve() {
  if (!solution_) solution_ = CalibrateCell(target_, sightings_, sizes_, config_);
  return *solution_;
}

}  // namespace fringe_fusion
