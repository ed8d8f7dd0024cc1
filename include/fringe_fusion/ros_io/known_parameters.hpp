#pragma once

#include <ros/node_handle.h>

#include <string>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::ros_io {

/// Remembers, for the life of the process, that a node knows this parameter. Thread-safe.
void DeclareParameter(const std::string& resolved_name);

/// A misspelt key would leave its setting as it was, without a word.
/// @return error naming the first parameter below `private_nh` that was never declared.
[[nodiscard]] Status CheckNoUnknownParameter(const ros::NodeHandle& private_nh);

}  // namespace fringe_fusion::ros_io
