#pragma once

#include <sensor_msgs/Image.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/Header.h>

#include <cstdint>
#include <string>

#include "fringe_fusion/common/image.hpp"
#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/triangulation/range_image.hpp"

namespace fringe_fusion::ros_io {

/// 32FC1; NaN stays NaN.
[[nodiscard]] sensor_msgs::Image ToMessage(const Image<float>& image,
                                           const std_msgs::Header& header);
/// Inverse of the above; a picture without data becomes an empty image.
/// @param owner names the picture in the message of an error.
/// @return error for another encoding or byte order, or sizes that do not fit the data.
[[nodiscard]] Result<Image<float>> FloatImageFromMessage(const sensor_msgs::Image& message,
                                                         const std::string& owner);
/// mono8.
[[nodiscard]] sensor_msgs::Image ToMessage(const Image<std::uint8_t>& image,
                                           const std_msgs::Header& header);
/// rgb8.
[[nodiscard]] sensor_msgs::Image ToMessage(const Image<Rgb8>& image,
                                           const std_msgs::Header& header);

/// The normals alone as the x y z of an organised cloud.
[[nodiscard]] sensor_msgs::PointCloud2 ToNormalCloud(const RangeImage& range,
                                                     const std::string& frame_id);

}  // namespace fringe_fusion::ros_io
