#pragma once

#include <fringe_fusion/CalibrationState.h>
#include <std_msgs/Header.h>
#include <visualization_msgs/MarkerArray.h>

#include <string>
#include <vector>

#include "fringe_fusion/calibration/calibrate_cell.hpp"

namespace fringe_fusion::ros_io {

/// Poses that make no solution, or none yet.
/// @param verdict why there is none.
[[nodiscard]] CalibrationState ToMessage(const std::vector<TargetSighting>& sightings,
                                         const Coverage& coverage, const std::string& verdict,
                                         const std_msgs::Header& header);

/// A solution with everything that people look at.
[[nodiscard]] CalibrationState ToMessage(const CellCalibrationResult& result,
                                         const std_msgs::Header& header);

/// Outlines of the target at its poses (green: takes part, red: left out), every residual as a line
/// at its point, `enlarge` times its length there (blue: camera, orange: projector), and the next
/// useful pose in yellow with its words. The first marker clears what was shown before.
/// @param header frame_id: the camera's optical frame.
[[nodiscard]] visualization_msgs::MarkerArray ToMarkers(const CellCalibrationResult& result,
                                                        const std_msgs::Header& header,
                                                        double enlarge);

/// Clears all markers.
[[nodiscard]] visualization_msgs::MarkerArray NoMarkers(const std_msgs::Header& header);

}  // namespace fringe_fusion::ros_io
