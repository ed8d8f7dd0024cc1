#pragma once

#include <fringe_fusion/RangeView.h>
#include <fringe_fusion/ViewPoses.h>
#include <sensor_msgs/PointCloud2.h>

#include <string>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/pose/view.hpp"
#include "fringe_fusion/registration/register_views.hpp"

namespace fringe_fusion::ros_io {

/// Organised cloud: x y z [m], normal_x normal_y normal_z, rgb, sigma_range sigma_lateral [m];
/// NaN where invalid. Stamped with the first frame.
[[nodiscard]] sensor_msgs::PointCloud2 ToPointCloud(const RangeImage& range,
                                                    const std::string& frame_id);
/// Inverse of ToPointCloud; the fields may lie in any order and among others.
/// @return error naming a missing field, or sizes that do not fit the data.
[[nodiscard]] Result<RangeImage> FromPointCloud(const sensor_msgs::PointCloud2& cloud);

/// Where a view belongs.
struct ViewContext {
  std::string scan_id;
  std::string calibration_id;
  std::string camera_frame;
  std::string object_frame;
};

[[nodiscard]] RangeView ToMessage(const View& view, const ViewContext& context);
/// @return error naming scan and view when points or pose are malformed.
[[nodiscard]] Result<View> FromMessage(const RangeView& message);

[[nodiscard]] ViewPose ToMessage(const RegisteredView& view);
/// @return error naming the view when pose or source are malformed.
[[nodiscard]] Result<RegisteredView> FromMessage(const ViewPose& message);

}  // namespace fringe_fusion::ros_io
