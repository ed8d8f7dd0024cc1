#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/calibrate_cell.hpp"

namespace fringe_fusion {

/// How the points of sightings fill both images, before anything is solved: ratios and gaps alone.
[[nodiscard]] Coverage CoverageOf(const std::vector<TargetSighting>& sightings,
                                  const DeviceSizes& sizes, double min_ratio);

/// Poses of a target that come and go one by one, and the calibration that they give.
class CellSession {
 public:
  CellSession(CalibrationTarget target, const DeviceSizes& sizes, const CalibrationConfig& config)
      : target_(std::move(target)), sizes_(sizes), config_(config) {}

  /// @return error when a pose of this name is there already.
  [[nodiscard]] Status Add(TargetSighting sighting);
  /// @param name "": the pose that came last. @return error naming the poses that there are.
  [[nodiscard]] Status Remove(const std::string& name);
  void Clear();

  [[nodiscard]] const CalibrationTarget& target() const { return target_; }
  [[nodiscard]] const DeviceSizes& sizes() const { return sizes_; }
  [[nodiscard]] const CalibrationConfig& config() const { return config_; }
  [[nodiscard]] const std::vector<TargetSighting>& sightings() const { return sightings_; }

  /// CalibrateCell on all poses; done once for the same poses.
  [[nodiscard]] const Result<CellCalibrationResult>& Solve();

 private:
  CalibrationTarget target_;
  DeviceSizes sizes_;
  CalibrationConfig config_;
  std::vector<TargetSighting> sightings_;
  std::optional<Result<CellCalibrationResult>> solution_;  ///< of these sightings
};

}  // namespace fringe_fusion
