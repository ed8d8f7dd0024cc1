#include "fringe_fusion/ros_io/view_messages.hpp"

#include <array>
#include <cstring>
#include <limits>

#include "fringe_fusion/ros_io/frame_messages.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"

namespace fringe_fusion::ros_io {
namespace {

// One point as it lies in the cloud.
constexpr std::array<const char*, 9> kFieldNames{
    "x", "y", "z", "normal_x", "normal_y", "normal_z", "rgb", "sigma_range", "sigma_lateral"};
constexpr std::size_t kNumFields = kFieldNames.size();
constexpr std::uint32_t kMaxCloudSidePx = 1U << 16U;
using PointFields = std::array<float, kNumFields>;

// rviz and PCL read a colour from the bits of a float.
float PackColor(const Rgb8& color) {
  const std::uint32_t bits = (static_cast<std::uint32_t>(color.r) << 16U) |
                             (static_cast<std::uint32_t>(color.g) << 8U) | color.b;
  float packed = 0.0F;
  std::memcpy(&packed, &bits, sizeof(packed));
  return packed;
}

Rgb8 UnpackColor(float packed) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &packed, sizeof(bits));
  return {static_cast<std::uint8_t>(bits >> 16U), static_cast<std::uint8_t>(bits >> 8U),
          static_cast<std::uint8_t>(bits)};
}

Result<std::array<std::size_t, kNumFields>> FieldOffsets(const sensor_msgs::PointCloud2& cloud) {
  std::array<std::size_t, kNumFields> offsets{};
  for (std::size_t i = 0; i < kNumFields; ++i) {
    bool found = false;
    for (const sensor_msgs::PointField& field : cloud.fields) {
      if (field.name != kFieldNames[i]) continue;
      if (field.datatype != sensor_msgs::PointField::FLOAT32 || field.count != 1 ||
          field.offset + sizeof(float) > cloud.point_step) {
        return Fail("cloud field '{}' must be one float32 inside a point of {} bytes", field.name,
                    cloud.point_step);
      }
      offsets[i] = field.offset;
      found = true;
    }
    if (!found) return Fail("cloud has no field '{}'", kFieldNames[i]);
  }
  return offsets;
}

Status CheckCloudSize(const sensor_msgs::PointCloud2& cloud) {
  if (cloud.width == 0 || cloud.height == 0 || cloud.width > kMaxCloudSidePx ||
      cloud.height > kMaxCloudSidePx) {
    return Fail("cloud size {} x {} must be 1 .. {}", cloud.width, cloud.height, kMaxCloudSidePx);
  }
  const std::size_t row_bytes = static_cast<std::size_t>(cloud.point_step) * cloud.width;
  if (cloud.is_bigendian != 0 || cloud.row_step < row_bytes ||
      cloud.data.size() < static_cast<std::size_t>(cloud.row_step) * cloud.height) {
    return Fail("cloud of {} x {} points has row step {} and {} bytes, too few or big-endian",
                cloud.width, cloud.height, cloud.row_step, cloud.data.size());
  }
  return {};
}

}  // namespace

sensor_msgs::PointCloud2 ToPointCloud(const RangeImage& range, const std::string& frame_id) {
  sensor_msgs::PointCloud2 cloud;
  cloud.header.stamp = ToRosTime(range.first_stamp_ns);
  cloud.header.frame_id = frame_id;
  cloud.width = static_cast<std::uint32_t>(range.width);
  cloud.height = static_cast<std::uint32_t>(range.height);
  for (std::size_t i = 0; i < kNumFields; ++i) {
    sensor_msgs::PointField field;
    field.name = kFieldNames[i];
    field.offset = static_cast<std::uint32_t>(i * sizeof(float));
    field.datatype = sensor_msgs::PointField::FLOAT32;
    field.count = 1;
    cloud.fields.push_back(field);
  }
  cloud.point_step = static_cast<std::uint32_t>(sizeof(PointFields));
  cloud.row_step = cloud.point_step * cloud.width;
  cloud.is_dense = 0;
  cloud.data.resize(range.points.size() * sizeof(PointFields));
  for (std::size_t i = 0; i < range.points.size(); ++i) {
    const Eigen::Vector3f& p = range.points[i];
    const Eigen::Vector3f& n = range.normals[i];
    const PointFields point{p.x(),
                            p.y(),
                            p.z(),
                            n.x(),
                            n.y(),
                            n.z(),
                            PackColor(range.color[i]),
                            range.sigma_range[i],
                            range.sigma_lateral[i]};
    std::memcpy(cloud.data.data() + i * sizeof(point), point.data(), sizeof(point));
  }
  return cloud;
}

Result<RangeImage> FromPointCloud(const sensor_msgs::PointCloud2& cloud) {
  if (Status status = CheckCloudSize(cloud); !status) {
    return tl::unexpected<Error>(status.error());
  }
  const Result<std::array<std::size_t, kNumFields>> offsets = FieldOffsets(cloud);
  if (!offsets) return Forward(offsets);
  RangeImage range = MakeRangeImage(static_cast<int>(cloud.width), static_cast<int>(cloud.height));
  for (int y = 0; y < range.height; ++y) {
    for (int x = 0; x < range.width; ++x) {
      const std::uint8_t* bytes = cloud.data.data() + static_cast<std::size_t>(y) * cloud.row_step +
                                  static_cast<std::size_t>(x) * cloud.point_step;
      PointFields f{};
      for (std::size_t i = 0; i < kNumFields; ++i) {
        std::memcpy(&f[i], bytes + (*offsets)[i], sizeof(float));
      }
      range.points(x, y) = {f[0], f[1], f[2]};
      range.normals(x, y) = {f[3], f[4], f[5]};
      range.color(x, y) = UnpackColor(f[6]);
      range.sigma_range(x, y) = f[7];
      range.sigma_lateral(x, y) = f[8];
    }
  }
  range.first_stamp_ns = FromRosTime(cloud.header.stamp);
  range.last_stamp_ns = range.first_stamp_ns;
  return range;
}

RangeView ToMessage(const View& view, const ViewContext& context) {
  RangeView message;
  message.points = ToPointCloud(view.range, context.camera_frame);
  message.header = message.points.header;
  message.last_stamp = ToRosTime(view.range.last_stamp_ns);
  message.scan_id = context.scan_id;
  message.view_id = static_cast<std::uint32_t>(view.id);
  message.calibration_id = context.calibration_id;
  const auto& projector = view.range.line_of_sight.projector;
  message.has_projector = static_cast<std::uint8_t>(projector.has_value());
  if (projector) {
    message.projector.x = static_cast<double>(projector->x());
    message.projector.y = static_cast<double>(projector->y());
    message.projector.z = static_cast<double>(projector->z());
  }
  message.pose_source = PoseSourceName(view.pose.source);
  message.pose.header.stamp = message.header.stamp;
  message.pose.header.frame_id = context.object_frame;
  message.pose.pose = ToMessage(view.pose);
  return message;
}

Result<View> FromMessage(const RangeView& message) {
  const auto prefix = [&message](const Error& error) {
    return Fail("view {} of scan '{}': {}", message.view_id, message.scan_id, error.message);
  };
  if (message.view_id > static_cast<std::uint32_t>(std::numeric_limits<int>::max())) {
    return prefix(Error{"view id is beyond 2147483647"});
  }
  Result<RangeImage> range = FromPointCloud(message.points);
  if (!range) return prefix(range.error());
  const Result<Pose> pose = FromMessage(message.pose.pose, message.pose_source);
  if (!pose) return prefix(pose.error());
  View view;
  view.id = static_cast<int>(message.view_id);
  view.name = fmt::format("{:03}", view.id);
  view.range = std::move(*range);
  view.range.last_stamp_ns = FromRosTime(message.last_stamp);
  if (message.has_projector != 0) {
    const Eigen::Vector3d projector(message.projector.x, message.projector.y, message.projector.z);
    if (!projector.allFinite()) return prefix(Error{"projector centre is not finite"});
    view.range.line_of_sight.projector = projector.cast<float>();
  }
  view.pose = *pose;
  return view;
}

ViewPose ToMessage(const RegisteredView& view) {
  ViewPose message;
  message.view_id = static_cast<std::uint32_t>(view.id);
  message.pose_source = PoseSourceName(view.pose.source);
  message.pose = ToMessage(view.pose);
  message.overlap = view.overlap_ratio;
  message.rms = view.rms_m;
  message.connected = static_cast<std::uint8_t>(view.connected);
  return message;
}

Result<RegisteredView> FromMessage(const ViewPose& message) {
  const Result<Pose> pose = FromMessage(message.pose, message.pose_source);
  if (!pose) return Fail("pose of view {}: {}", message.view_id, pose.error().message);
  RegisteredView view;
  view.id = static_cast<int>(message.view_id);
  view.pose = *pose;
  view.overlap_ratio = message.overlap;
  view.rms_m = message.rms;
  view.connected = message.connected != 0;
  return view;
}

}  // namespace fringe_fusion::ros_io
