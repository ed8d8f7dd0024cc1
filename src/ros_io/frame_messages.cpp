#include "fringe_fusion/ros_io/frame_messages.hpp"

#include <sensor_msgs/image_encodings.h>

#include <cstring>
#include <type_traits>

#include "fringe_fusion/ros_io/pattern_messages.hpp"

namespace fringe_fusion::ros_io {
namespace {

constexpr std::uint32_t kMaxSidePx = 1U << 16U;

template <typename Pixel>
Result<FramePixels> CopyPixels(const sensor_msgs::Image& message) {
  const std::size_t row_bytes = message.width * sizeof(Pixel);
  if (message.step < row_bytes ||
      message.data.size() < static_cast<std::size_t>(message.step) * message.height) {
    return Fail("image of {} x {} px has step {} and {} bytes, too few", message.width,
                message.height, message.step, message.data.size());
  }
  Image<Pixel> image(static_cast<int>(message.width), static_cast<int>(message.height));
  for (int y = 0; y < image.height(); ++y) {
    const std::size_t offset = static_cast<std::size_t>(y) * message.step;
    std::memcpy(image.row(y), message.data.data() + offset, row_bytes);
  }
  return FramePixels(std::move(image));
}

}  // namespace

ros::Time ToRosTime(std::int64_t stamp_ns) {
  return ros::Time().fromNSec(static_cast<std::uint64_t>(stamp_ns));
}

std::int64_t FromRosTime(const ros::Time& stamp) {
  return static_cast<std::int64_t>(stamp.toNSec());
}

sensor_msgs::Image ToMessage(const CapturedFrame& frame, const std::string& frame_id) {
  sensor_msgs::Image message;
  message.header.stamp = ToRosTime(frame.stamp_ns);
  message.header.frame_id = frame_id;
  message.width = static_cast<std::uint32_t>(Width(frame));
  message.height = static_cast<std::uint32_t>(Height(frame));
  std::visit(
      [&message](const auto& image) {
        using Pixel = std::decay_t<decltype(image[0])>;
        message.encoding = sizeof(Pixel) == 1 ? sensor_msgs::image_encodings::MONO8
                                              : sensor_msgs::image_encodings::MONO16;
        message.step = static_cast<std::uint32_t>(message.width * sizeof(Pixel));
        const auto* bytes = reinterpret_cast<const std::uint8_t*>(image.data());
        message.data.assign(bytes, bytes + image.size() * sizeof(Pixel));
      },
      frame.pixels);
  return message;
}

Result<CapturedFrame> FromMessage(const sensor_msgs::Image& message, const ExposureInfo& exposure) {
  if (message.width == 0 || message.height == 0 || message.width > kMaxSidePx ||
      message.height > kMaxSidePx) {
    return Fail("image size {} x {} px must be 1 .. {}", message.width, message.height, kMaxSidePx);
  }
  const bool is_16_bit = message.encoding == sensor_msgs::image_encodings::MONO16;
  if (!is_16_bit && message.encoding != sensor_msgs::image_encodings::MONO8) {
    return Fail("image encoding '{}' must be mono8 or mono16", message.encoding);
  }
  if (is_16_bit && message.is_bigendian != 0) return Fail("image is big-endian, must be little");
  const int max_bits = is_16_bit ? 16 : 8;
  if (exposure.bit_depth < 1 || exposure.bit_depth > max_bits) {
    return Fail("bit depth {} of a {} image must be 1 .. {}", exposure.bit_depth, message.encoding,
                max_bits);
  }
  Result<FramePixels> pixels =
      is_16_bit ? CopyPixels<std::uint16_t>(message) : CopyPixels<std::uint8_t>(message);
  if (!pixels) return Forward(pixels);
  CapturedFrame frame;
  frame.pixels = std::move(*pixels);
  frame.bit_depth = exposure.bit_depth;
  frame.stamp_ns = FromRosTime(message.header.stamp);
  frame.exposure_s = exposure.exposure_s;
  frame.gain = exposure.gain;
  return frame;
}

Frame ToMessage(const ImageStack& stack, std::size_t index, const std::string& frame_id) {
  const CapturedFrame& frame = stack.frames.at(index);
  Frame message;
  message.image = ToMessage(frame, frame_id);
  message.header = message.image.header;
  message.scan_id = stack.scan_id;
  message.view_id = static_cast<std::uint32_t>(stack.view_id);
  message.index = static_cast<std::uint32_t>(index);
  message.num_frames = static_cast<std::uint32_t>(stack.sequence.frames.size());
  message.projector_width = static_cast<std::uint32_t>(stack.sequence.width);
  message.projector_height = static_cast<std::uint32_t>(stack.sequence.height);
  message.pattern = ToMessage(stack.sequence.frames.at(index));
  message.exposure = frame.exposure_s;
  message.gain = frame.gain;
  message.bit_depth = static_cast<std::uint32_t>(frame.bit_depth);
  return message;
}

Result<CapturedFrame> FromMessage(const Frame& message) {
  ExposureInfo exposure;
  exposure.bit_depth = message.bit_depth <= 16 ? static_cast<int>(message.bit_depth) : 0;
  exposure.exposure_s = message.exposure;
  exposure.gain = message.gain;
  Result<CapturedFrame> frame = FromMessage(message.image, exposure);
  if (!frame) {
    return Fail("frame {} of view {} of scan '{}': {}", message.index, message.view_id,
                message.scan_id, frame.error().message);
  }
  return frame;
}

}  // namespace fringe_fusion::ros_io
