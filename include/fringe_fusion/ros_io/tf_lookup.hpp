#pragma once

#include <ros/time.h>
#include <tf2_ros/buffer.h>

#include <string>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/geometry/transform.hpp"

namespace fringe_fusion::ros_io {

/// What is looked up: T_target_source at a stamp; stamp 0 is the latest.
struct TransformQuery {
  std::string target_frame;
  std::string source_frame;
  ros::Time stamp;
};

/// T_target_source from tf, waiting for it up to timeout_s of wall time. The buffer must be filled
/// by another thread.
/// @return error naming frames, stamp and what tf says.
[[nodiscard]] Result<Transform> LookupTransform(const tf2_ros::Buffer& buffer,
                                                const TransformQuery& query, double timeout_s);

}  // namespace fringe_fusion::ros_io
