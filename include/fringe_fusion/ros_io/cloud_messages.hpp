#pragma once

#include <sensor_msgs/PointCloud2.h>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion::ros_io {

/// The finite points of any PointCloud2 with float fields x, y, z, and their colour if it has a
/// field rgb or rgba. Other fields are ignored.
/// @return error naming the field or the sizes that do not fit, or a cloud without finite points.
[[nodiscard]] Result<Mesh> ToCloud(const sensor_msgs::PointCloud2& message);

}  // namespace fringe_fusion::ros_io
