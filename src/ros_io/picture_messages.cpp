#include "fringe_fusion/ros_io/picture_messages.hpp"

#include <sensor_msgs/image_encodings.h>

#include <cstring>

#include "fringe_fusion/ros_io/frame_messages.hpp"

namespace fringe_fusion::ros_io {
namespace {

template <typename Pixel>
sensor_msgs::Image CopyImage(const Image<Pixel>& image, const std_msgs::Header& header,
                             const std::string& encoding) {
  sensor_msgs::Image message;
  message.header = header;
  message.width = static_cast<std::uint32_t>(image.width());
  message.height = static_cast<std::uint32_t>(image.height());
  message.encoding = encoding;
  message.step = static_cast<std::uint32_t>(message.width * sizeof(Pixel));
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(image.data());
  message.data.assign(bytes, bytes + image.size() * sizeof(Pixel));
  return message;
}

}  // namespace

sensor_msgs::Image ToMessage(const Image<float>& image, const std_msgs::Header& header) {
  return CopyImage(image, header, sensor_msgs::image_encodings::TYPE_32FC1);
}

Result<Image<float>> FloatImageFromMessage(const sensor_msgs::Image& message,
                                           const std::string& owner) {
  if (message.data.empty() && message.width == 0 && message.height == 0) return Image<float>();
  if (message.encoding != sensor_msgs::image_encodings::TYPE_32FC1 || message.is_bigendian != 0) {
    return Fail("{}: encoding '{}' must be 32FC1, little-endian", owner, message.encoding);
  }
  constexpr std::uint32_t kMaxSidePx = 1U << 16U;
  const std::size_t expected = std::size_t{message.width} * message.height * sizeof(float);
  if (message.width > kMaxSidePx || message.height > kMaxSidePx ||
      message.step != message.width * sizeof(float) || message.data.size() != expected) {
    return Fail("{}: {} bytes in rows of {} do not make {} x {} px of 4 bytes", owner,
                message.data.size(), message.step, message.width, message.height);
  }
  Image<float> image(static_cast<int>(message.width), static_cast<int>(message.height));
  std::memcpy(image.data(), message.data.data(), expected);
  return image;
}

sensor_msgs::Image ToMessage(const Image<std::uint8_t>& image, const std_msgs::Header& header) {
  return CopyImage(image, header, sensor_msgs::image_encodings::MONO8);
}

sensor_msgs::Image ToMessage(const Image<Rgb8>& image, const std_msgs::Header& header) {
  static_assert(sizeof(Rgb8) == 3, "rgb8 is three bytes");
  return CopyImage(image, header, sensor_msgs::image_encodings::RGB8);
}

sensor_msgs::PointCloud2 ToNormalCloud(const RangeImage& range, const std::string& frame_id) {
  sensor_msgs::PointCloud2 cloud;
  cloud.header.stamp = ToRosTime(range.first_stamp_ns);
  cloud.header.frame_id = frame_id;
  cloud.width = static_cast<std::uint32_t>(range.width);
  cloud.height = static_cast<std::uint32_t>(range.height);
  std::uint32_t offset = 0;
  for (const char* name : {"x", "y", "z"}) {
    sensor_msgs::PointField field;
    field.name = name;
    field.offset = offset;
    field.datatype = sensor_msgs::PointField::FLOAT32;
    field.count = 1;
    cloud.fields.push_back(field);
    offset += static_cast<std::uint32_t>(sizeof(float));
  }
  cloud.point_step = offset;
  cloud.row_step = cloud.point_step * cloud.width;
  cloud.is_dense = 0;
  cloud.data.resize(range.normals.size() * cloud.point_step);
  for (std::size_t i = 0; i < range.normals.size(); ++i) {
    std::memcpy(cloud.data.data() + i * cloud.point_step, range.normals[i].data(),
                cloud.point_step);
  }
  return cloud;
}

}  // namespace fringe_fusion::ros_io
