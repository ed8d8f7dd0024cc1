#include "fringe_fusion/ros_io/truth_messages.hpp"

#include <sensor_msgs/PointField.h>

#include <array>
#include <cstring>

namespace fringe_fusion::ros_io {
namespace {

constexpr std::array<const char*, 8> kFloatFields = {"x",        "y",        "z", "normal_x",
                                                     "normal_y", "normal_z", "u", "v"};
constexpr std::array<const char*, 2> kByteFields = {"lit", "on_part"};

void AddField(sensor_msgs::PointCloud2& cloud, const char* name, std::uint8_t datatype,
              std::uint32_t size_bytes) {
  sensor_msgs::PointField field;
  field.name = name;
  field.offset = cloud.point_step;
  field.datatype = datatype;
  field.count = 1;
  cloud.fields.push_back(field);
  cloud.point_step += size_bytes;
}

}  // namespace

sensor_msgs::PointCloud2 ToMessage(const sim::ViewTruth& truth) {
  sensor_msgs::PointCloud2 cloud;
  for (const char* name : kFloatFields) {
    AddField(cloud, name, sensor_msgs::PointField::FLOAT32, sizeof(float));
  }
  for (const char* name : kByteFields) {
    AddField(cloud, name, sensor_msgs::PointField::UINT8, sizeof(std::uint8_t));
  }
  cloud.width = static_cast<std::uint32_t>(truth.points.width());
  cloud.height = static_cast<std::uint32_t>(truth.points.height());
  cloud.row_step = cloud.width * cloud.point_step;
  cloud.data.resize(static_cast<std::size_t>(cloud.row_step) * cloud.height);
  for (std::size_t i = 0; i < truth.points.size(); ++i) {
    const Eigen::Vector3f& point = truth.points[i];
    const Eigen::Vector3f& normal = truth.normals[i];
    const std::array<float, kFloatFields.size()> floats = {point.x(),  point.y(),  point.z(),
                                                           normal.x(), normal.y(), normal.z(),
                                                           truth.u[i], truth.v[i]};
    std::uint8_t* bytes = cloud.data.data() + i * cloud.point_step;
    std::memcpy(bytes, floats.data(), sizeof(floats));
    bytes[sizeof(floats)] = truth.lit[i];
    bytes[sizeof(floats) + 1] = truth.on_part[i];
  }
  return cloud;
}

}  // namespace fringe_fusion::ros_io
