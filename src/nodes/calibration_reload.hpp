#pragma once

#include <ros/node_handle.h>
#include <std_srvs/Trigger.h>

#include <functional>
#include <string>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::nodes {

/// A calibration file that has changed since a node started.
/// @param in_force what the node works with.
/// @return error naming the file where it cannot be read, or where it is of other devices or of
/// other sizes: for those a node must start anew.
[[nodiscard]] Result<CellCalibration> RereadCalibration(const std::string& file,
                                                        const CellCalibration& in_force);

/// Service `~reload_calibration`, by which calibration_node puts a calibration in force.
/// @param reload takes the file again; its failure is the answer, and logged.
[[nodiscard]] ros::ServiceServer AdvertiseReload(ros::NodeHandle private_nh,
                                                 std::function<Status()> reload);

}  // namespace fringe_fusion::nodes
