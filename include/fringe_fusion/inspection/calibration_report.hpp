#pragma once

#include <string>
#include <vector>

#include "fringe_fusion/calibration/error_field.hpp"
#include "fringe_fusion/common/image.hpp"
#include "fringe_fusion/inspection/report.hpp"

namespace fringe_fusion {

/// Residuals of one device, measured minus predicted: one dot a point, one colour a pose, a circle
/// at the rms distance. The axes go to the largest residual.
[[nodiscard]] Image<Rgb8> DrawResidualScatter(const CellCalibrationResult& result,
                                              bool in_projector);

/// Where one device saw points: its image with the grid of Coverage, cells without a point shaded,
/// and every residual as a line from the measured pixel, enlarged by the factor that is written
/// below. A pattern in the lines is what the lens model leaves.
[[nodiscard]] Image<Rgb8> DrawResidualField(const CellCalibrationResult& result, bool in_projector);

/// Slices of an error field: a row for every z, columns for the standard deviations of X, Y and Z
/// from the calibration, one colour scale; grey where a device does not see the point.
[[nodiscard]] Image<Rgb8> DrawErrorSlices(const ErrorField& field);

/// The page without its pictures: verdict, parameters with standard deviations, poses and why some
/// were left out, bad detections, distortion models that were tried, predicted error by depth.
/// @param skipped pictures in which the target was not found, in words.
[[nodiscard]] Report MakeCalibrationReport(const CellCalibrationResult& result,
                                           const std::vector<std::string>& skipped,
                                           const ErrorField& field);

/// Writes report.html and its pictures into a folder that exists.
/// @return error naming the file that cannot be written.
[[nodiscard]] Status WriteCalibrationReport(const CellCalibrationResult& result,
                                            const std::vector<std::string>& skipped,
                                            const std::string& folder);

}  // namespace fringe_fusion
