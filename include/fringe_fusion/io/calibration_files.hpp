#pragma once

#include <string>
#include <vector>

#include "fringe_fusion/calibration/calibrate_cell.hpp"
#include "fringe_fusion/calibration/target.hpp"

namespace fringe_fusion {

struct ScanFolder;

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

/// Opens a scan folder whose devices are not calibrated yet: cell.yaml is neither needed nor read;
/// the sizes are those of the first frame and of patterns.yaml, the lens models mean nothing.
/// @return error naming the folder or file; a folder without a view is one.
[[nodiscard]] Result<ScanFolder> OpenUncalibratedScan(const std::string& path);

/// cell.yaml with the covariance of its numbers and the verdict.
[[nodiscard]] Status WriteCalibratedCell(const CellCalibrationResult& result,
                                         const std::string& path);
/// Covariance of a cell.yaml, in the order of CellParameterName.
/// @return error naming file and key; a file that states none is one.
[[nodiscard]] Result<CellCovariance> ReadCellCovariance(const std::string& path);

/// Date of a calibration as cell.yaml states it: UTC, ISO 8601.
/// @param stamp_ns since 1970. @return empty for a stamp that is not known, 0.
[[nodiscard]] std::string UtcDate(std::int64_t stamp_ns);

/// camera_info of ROS (camera_calibration_parsers), as camera_info_manager loads it.
[[nodiscard]] Status WriteCameraInfo(const CameraModel& model, const std::string& name,
                                     const std::string& path);

}  // namespace fringe_fusion
