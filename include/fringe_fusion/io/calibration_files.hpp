#pragma once

#include <string>
#include <vector>

#include "fringe_fusion/calibration/target.hpp"

namespace fringe_fusion {

/// target.yaml: kind, columns, rows, pitch_m and what the kind needs, lengths in metres.
/// @return error naming file, key, value and bound; unknown keys are errors.
[[nodiscard]] Result<CalibrationTarget> LoadTarget(const std::string& path);
[[nodiscard]] Status SaveTarget(const CalibrationTarget& target, const std::string& path);

/// sightings.yaml: a target and where its points were seen, so that calibrations can be solved
/// again without pictures.
struct SightingsFile {
  CalibrationTarget target;
  int camera_width = 0;
  int camera_height = 0;
  int projector_width = 0;   ///< 0: no projector
  int projector_height = 0;  ///< 0: no projector
  std::vector<TargetSighting> sightings;
};

/// Numbers survive a round trip bit by bit.
/// @return error naming file, sighting, key and value; a point that the target does not have, that
/// occurs twice, or whose covariance is not positive definite is one.
[[nodiscard]] Result<SightingsFile> LoadSightings(const std::string& path);
[[nodiscard]] Status SaveSightings(const SightingsFile& file, const std::string& path);

}  // namespace fringe_fusion
