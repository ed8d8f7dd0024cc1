#include "fringe_fusion/ros_io/octomap_message.hpp"

namespace fringe_fusion::ros_io {

OctomapMessage ToMessage(const OccupancyMap& map, const std::string& frame_id,
                         const ros::Time& stamp) {
  OctomapMessage message;
  message.header.frame_id = frame_id;
  message.header.stamp = stamp;
  message.binary = 1;
  message.id = map.TreeType();
  message.resolution = map.resolution_m();
  message.data = map.BinaryData();
  return message;
}

}  // namespace fringe_fusion::ros_io
