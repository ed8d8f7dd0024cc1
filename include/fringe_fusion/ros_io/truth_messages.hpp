#pragma once

#include <sensor_msgs/PointCloud2.h>

#include "fringe_fusion/sim/sim_cell.hpp"

namespace fringe_fusion::ros_io {

/// Exact answers of the simulated cell as an organised cloud of the camera frame, one point per
/// camera pixel: x y z [m], normal_x normal_y normal_z, u v [projector px] (float32, NaN where the
/// ray hits nothing), lit and on_part (uint8). The header is left to the caller.
[[nodiscard]] sensor_msgs::PointCloud2 ToMessage(const sim::ViewTruth& truth);

}  // namespace fringe_fusion::ros_io
