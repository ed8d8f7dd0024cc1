#pragma once

#include <ros/time.h>

#include <string>

#include "fringe_fusion/planning/occupancy_map.hpp"

// Debian does not package octomap_msgs. Where the build finds it, its own type is used; elsewhere a
// struct that is the same on the wire, so that any receiver takes it for octomap_msgs/Octomap.
#if __has_include(<octomap_msgs/Octomap.h>)
#include <octomap_msgs/Octomap.h>
namespace fringe_fusion::ros_io {
using OctomapMessage = octomap_msgs::Octomap;
}  // namespace fringe_fusion::ros_io
#else
#include <ros/message_traits.h>
#include <ros/serialization.h>
#include <std_msgs/Header.h>

#include <vector>

namespace fringe_fusion::ros_io {
/// Wire format of octomap_msgs/Octomap.
struct OctomapMessage {
  std_msgs::Header header;
  std::uint8_t binary = 1;
  std::string id;
  double resolution = 0.0;
  std::vector<std::int8_t> data;
};
}  // namespace fringe_fusion::ros_io

namespace ros {
namespace message_traits {
template <>
struct IsMessage<fringe_fusion::ros_io::OctomapMessage> : TrueType {};
template <>
struct IsMessage<const fringe_fusion::ros_io::OctomapMessage> : TrueType {};
template <>
struct HasHeader<fringe_fusion::ros_io::OctomapMessage> : TrueType {};
template <>
struct MD5Sum<fringe_fusion::ros_io::OctomapMessage> {
  static const char* value() { return "9a45536b45c5e409cd49f04bb2d9999f"; }
  static const char* value(const fringe_fusion::ros_io::OctomapMessage& /*message*/) {
    return value();
  }
};
template <>
struct DataType<fringe_fusion::ros_io::OctomapMessage> {
  static const char* value() { return "octomap_msgs/Octomap"; }
  static const char* value(const fringe_fusion::ros_io::OctomapMessage& /*message*/) {
    return value();
  }
};
template <>
struct Definition<fringe_fusion::ros_io::OctomapMessage> {
  static const char* value() {
    return "Header header\nbool binary\nstring id\nfloat64 resolution\nint8[] data\n"
           "===================================================================="
           "============\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n";
  }
  static const char* value(const fringe_fusion::ros_io::OctomapMessage& /*message*/) {
    return value();
  }
};
}  // namespace message_traits
namespace serialization {
template <>
struct Serializer<fringe_fusion::ros_io::OctomapMessage> {
  template <typename Stream, typename Message>
  static void allInOne(Stream& stream, Message message) {
    stream.next(message.header);
    stream.next(message.binary);
    stream.next(message.id);
    stream.next(message.resolution);
    stream.next(message.data);
  }
  ROS_DECLARE_ALLINONE_SERIALIZER
};
}  // namespace serialization
}  // namespace ros
#endif

namespace fringe_fusion::ros_io {

/// The map as octomap_msgs/Octomap with binary = true.
[[nodiscard]] OctomapMessage ToMessage(const OccupancyMap& map, const std::string& frame_id,
                                       const ros::Time& stamp);

}  // namespace fringe_fusion::ros_io
