#include "fringe_fusion/ros_io/cloud_messages.hpp"

#include <array>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>

namespace fringe_fusion::ros_io {
namespace {

std::optional<std::size_t> FindField(const sensor_msgs::PointCloud2& message,
                                     const std::string& name, bool must_be_float) {
  for (const sensor_msgs::PointField& field : message.fields) {
    if (field.name != name || field.offset + sizeof(float) > message.point_step) continue;
    const bool is_float = field.datatype == sensor_msgs::PointField::FLOAT32;
    const bool is_word = field.datatype == sensor_msgs::PointField::UINT32;
    if (is_float || (is_word && !must_be_float)) return field.offset;
  }
  return std::nullopt;
}

Status CheckSizes(const sensor_msgs::PointCloud2& message) {
  if (message.is_bigendian != 0) return Fail("big-endian clouds are not supported");
  // In 64 bits, so that lying 32-bit sizes cannot wrap around.
  const std::uint64_t row = std::uint64_t{message.point_step} * message.width;
  if (message.point_step == 0 || message.row_step < row ||
      std::uint64_t{message.row_step} * message.height > message.data.size()) {
    return Fail("{} x {} points of {} bytes, rows of {} bytes, do not fit {} bytes of data",
                message.width, message.height, message.point_step, message.row_step,
                message.data.size());
  }
  return {};
}

template <typename T>
T ReadAt(const std::uint8_t* bytes) {
  T value{};
  std::memcpy(&value, bytes, sizeof(value));
  return value;
}

}  // namespace

Result<Mesh> ToCloud(const sensor_msgs::PointCloud2& message) {
  if (Status status = CheckSizes(message); !status) return tl::unexpected(status.error());
  std::array<std::size_t, 3> offsets{};
  const std::array<const char*, 3> names{"x", "y", "z"};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto offset = FindField(message, names[i], true);
    if (!offset) return Fail("has no float field '{}'", names[i]);
    offsets[i] = *offset;
  }
  auto color = FindField(message, "rgb", false);
  if (!color) color = FindField(message, "rgba", false);
  Mesh cloud;
  for (std::uint32_t y = 0; y < message.height; ++y) {
    for (std::uint32_t x = 0; x < message.width; ++x) {
      const std::uint8_t* bytes = message.data.data() +
                                  static_cast<std::size_t>(y) * message.row_step +
                                  static_cast<std::size_t>(x) * message.point_step;
      const Eigen::Vector3f point(ReadAt<float>(bytes + offsets[0]),
                                  ReadAt<float>(bytes + offsets[1]),
                                  ReadAt<float>(bytes + offsets[2]));
      if (!point.allFinite()) continue;
      cloud.vertices.push_back(point);
      if (!color) continue;
      const auto word = ReadAt<std::uint32_t>(bytes + *color);
      cloud.colors.push_back({static_cast<std::uint8_t>(word >> 16U),
                              static_cast<std::uint8_t>(word >> 8U),
                              static_cast<std::uint8_t>(word)});
    }
  }
  if (cloud.vertices.empty()) return Fail("has no finite point");
  return cloud;
}

}  // namespace fringe_fusion::ros_io
