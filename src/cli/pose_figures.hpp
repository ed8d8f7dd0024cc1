#pragma once

#include <vector>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/inspection/report.hpp"
#include "fringe_fusion/pose/epipolar_health.hpp"
#include "json.hpp"

namespace fringe_fusion::cli {

/// Angle between the estimated and the calibrated rotation [deg].
[[nodiscard]] double RotationDeg(const RelativePose& pose, const CellCalibration& calibration);
/// Angle between the estimated and the calibrated baseline [deg].
[[nodiscard]] double DirectionDeg(const RelativePose& pose, const CellCalibration& calibration);

// The figures of fringe pose as --json states them.
[[nodiscard]] Json PoseFigures(const RelativePose& pose, const CellCalibration& calibration);
[[nodiscard]] Json HealthFigures(int view_id, const HealthReport& report);
[[nodiscard]] Json DriftFigures(const Drift& drift);

// The same for people.
[[nodiscard]] Report::Table PoseTable(const RelativePose& pose, const CellCalibration& calibration);
[[nodiscard]] Report::Table HealthTable(const std::vector<int>& view_ids,
                                        const std::vector<HealthReport>& reports);

}  // namespace fringe_fusion::cli
