#pragma once

#include <string>
#include <vector>

#include "command.hpp"
#include "fringe_fusion/calibration/hand_eye.hpp"

namespace fringe_fusion::cli {

/// Poses of a device as --json states them.
[[nodiscard]] std::vector<Json> OutcomeFigures(const std::vector<DevicePoseOutcome>& poses);
/// The same for people, a line each.
void PrintOutcomes(const std::vector<DevicePoseOutcome>& poses);

/// "0.1 0.2 0.3 m +- 0.01 0.01 0.02 mm, rotation vector 1 2 3 deg +- ..." of T with covariance.
[[nodiscard]] std::string PoseWords(const Transform& T, const Matrix6d& covariance);
[[nodiscard]] Json PoseFigure(const Transform& T, const Matrix6d& covariance);

/// The error of a verdict that keeps a result from being written.
[[nodiscard]] tl::unexpected<Error> NotWritten(const std::string& path, const Verdict& verdict);

/// Sightings in the order of the names; those that are in none are told.
/// @return error for a name without a sighting.
[[nodiscard]] Result<std::vector<TargetSighting>> SightingsOf(
    const std::vector<std::string>& names, const std::vector<TargetSighting>& sightings,
    const std::string& file);

}  // namespace fringe_fusion::cli
