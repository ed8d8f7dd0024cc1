#pragma once

#include <string>

#include "fringe_fusion/calibration/target.hpp"
#include "yaml_fields.hpp"

namespace fringe_fusion::internal {

/// Reads the keys of target.yaml without checking their values.
void ReadTarget(YamlFields& fields, CalibrationTarget& target);
/// The keys of target.yaml that ReadTarget reads back bit by bit, one a line.
[[nodiscard]] std::string TargetYaml(const CalibrationTarget& target);

}  // namespace fringe_fusion::internal
