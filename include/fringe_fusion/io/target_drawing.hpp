#pragma once

#include <string>
#include <vector>

#include "fringe_fusion/calibration/target.hpp"

namespace fringe_fusion {

/// A sheet, upright.
struct Paper {
  double width_mm = 0.0;
  double height_mm = 0.0;
};

/// Names of the sheets that PaperFromName knows, e.g. "a4", "letter".
[[nodiscard]] std::vector<std::string> PaperNames();
/// A sheet by its name, or "WIDTHxHEIGHT" in millimetres.
/// @return error naming what there is.
[[nodiscard]] Result<Paper> PaperFromName(const std::string& name);

/// Writes a target true to scale on one sheet, laid across where it only fits so, with a line of
/// 100 mm to check the print by where there is room. PDF and SVG by the ending of the file.
/// @return error when the ending is unknown or the print does not fit the sheet, with both sizes.
[[nodiscard]] Status DrawTarget(const CalibrationTarget& target, const Paper& paper,
                                const std::string& path);

}  // namespace fringe_fusion
