#pragma once

#include <string>

#include "fringe_fusion/geometry/camera_model.hpp"
#include "yaml_fields.hpp"

namespace fringe_fusion::internal {

/// The flow map {width, height, fx, fy, cx, cy, distortion}.
void ReadModel(YamlFields& fields, CameraModel& model);
[[nodiscard]] std::string ModelYaml(const CameraModel& model);

}  // namespace fringe_fusion::internal
