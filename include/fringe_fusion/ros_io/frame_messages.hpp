#pragma once

#include <fringe_fusion/Frame.h>
#include <ros/time.h>
#include <sensor_msgs/Image.h>

#include <string>

#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::ros_io {

/// Stamps in the core are nanoseconds since 1970.
[[nodiscard]] ros::Time ToRosTime(std::int64_t stamp_ns);
[[nodiscard]] std::int64_t FromRosTime(const ros::Time& stamp);

/// mono8 or mono16 picture of one exposure, stamped with the middle of the exposure.
[[nodiscard]] sensor_msgs::Image ToMessage(const CapturedFrame& frame, const std::string& frame_id);

/// What an Image message does not say of an exposure.
struct ExposureInfo {
  int bit_depth = 8;
  double exposure_s = 0.0;
  double gain = 1.0;
};

/// @return error naming encoding, size or data length when they do not make a grey picture.
[[nodiscard]] Result<CapturedFrame> FromMessage(const sensor_msgs::Image& message,
                                                const ExposureInfo& exposure);

/// Frame `index` of a stack with the pattern that it shows.
/// @param frame_id the camera's optical frame.
[[nodiscard]] Frame ToMessage(const ImageStack& stack, std::size_t index,
                              const std::string& frame_id);

/// The exposure inside a Frame. @return error as above, naming scan, view and index.
[[nodiscard]] Result<CapturedFrame> FromMessage(const Frame& message);

}  // namespace fringe_fusion::ros_io
