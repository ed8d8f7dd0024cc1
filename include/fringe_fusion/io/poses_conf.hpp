#pragma once

#include <string>
#include <vector>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/geometry/transform.hpp"

namespace fringe_fusion {

/// One line `bmesh FILE tx ty tz qx qy qz qw` of a Stanford .conf: p_world = R(q)^T p + t.
struct ConfEntry {
  std::string file;                                   ///< relative to the .conf
  Transform T_object_camera = Transform::Identity();  ///< the transpose already applied
};

/// @return error naming file, line and value. A `camera` line is skipped.
[[nodiscard]] Result<std::vector<ConfEntry>> ReadPosesConf(const std::string& path);
[[nodiscard]] Status WritePosesConf(const std::vector<ConfEntry>& entries, const std::string& path);

}  // namespace fringe_fusion
