#pragma once

#include "command.hpp"
#include "fringe_fusion/calibration/sighting_from_scan.hpp"

namespace fringe_fusion::cli {

/// Settings of the stages between the frames of a target and its sighting: phase, detect, transfer.
[[nodiscard]] Result<SightingConfig> LoadSightingConfig(const Session& session);

}  // namespace fringe_fusion::cli
