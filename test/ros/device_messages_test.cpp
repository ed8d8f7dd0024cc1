// Conversions between pictures, lens models and truth of the core and their messages.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "fringe_fusion/ros_io/frame_messages.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"
#include "fringe_fusion/ros_io/truth_messages.hpp"

namespace fringe_fusion::ros_io {
namespace {

template <typename Pixel>
CapturedFrame Ramp(int bit_depth) {
  CapturedFrame frame;
  Image<Pixel> image(5, 3);
  for (std::size_t i = 0; i < image.size(); ++i) image[i] = static_cast<Pixel>(7 + 17 * i);
  frame.pixels = image;
  frame.bit_depth = bit_depth;
  frame.stamp_ns = 1700000000123456789;
  frame.exposure_s = 0.0125;
  frame.gain = 3.5;
  return frame;
}

template <typename Pixel>
void ExpectRoundTrip(const CapturedFrame& frame, const std::string& encoding) {
  const sensor_msgs::Image message = ToMessage(frame, "optics");
  EXPECT_EQ(message.header.frame_id, "optics");
  EXPECT_EQ(message.header.stamp, ros::Time(1700000000, 123456789));
  EXPECT_EQ(message.encoding, encoding);
  EXPECT_EQ(message.step, 5 * sizeof(Pixel));
  EXPECT_EQ(message.data.size(), 15 * sizeof(Pixel));
  const auto back = FromMessage(message, {frame.bit_depth, frame.exposure_s, frame.gain});
  ASSERT_TRUE(back) << back.error().message;
  const auto& pixels = std::get<Image<Pixel>>(back->pixels);
  const auto& expected = std::get<Image<Pixel>>(frame.pixels);
  EXPECT_TRUE(std::equal(pixels.begin(), pixels.end(), expected.begin(), expected.end()));
  EXPECT_EQ(back->stamp_ns, frame.stamp_ns);
  EXPECT_EQ(back->bit_depth, frame.bit_depth);
  EXPECT_EQ(back->exposure_s, frame.exposure_s);
  EXPECT_EQ(back->gain, frame.gain);
}

TEST(FrameMessages, KeepPicturesOfEightAndSixteenBits) {
  ExpectRoundTrip<std::uint8_t>(Ramp<std::uint8_t>(8), "mono8");
  ExpectRoundTrip<std::uint16_t>(Ramp<std::uint16_t>(12), "mono16");
}

TEST(FrameMessages, ReadRowsWithPadding) {
  sensor_msgs::Image message = ToMessage(Ramp<std::uint8_t>(8), "");
  message.step = 9;
  std::vector<std::uint8_t> padded(27, 255);
  for (std::size_t y = 0; y < 3; ++y) {
    std::memcpy(padded.data() + 9 * y, message.data.data() + 5 * y, 5);
  }
  message.data = padded;
  const auto frame = FromMessage(message, {});
  ASSERT_TRUE(frame);
  EXPECT_EQ(std::get<Image<std::uint8_t>>(frame->pixels)(4, 2), 7 + 17 * 14);
}

TEST(FrameMessages, RefuseWhatIsNoGreyPicture) {
  const sensor_msgs::Image good = ToMessage(Ramp<std::uint8_t>(8), "");
  sensor_msgs::Image bad = good;
  bad.encoding = "rgb8";
  EXPECT_NE(FromMessage(bad, {}).error().message.find("'rgb8' must be mono8"), std::string::npos);
  bad = good;
  bad.data.pop_back();
  EXPECT_NE(FromMessage(bad, {}).error().message.find("14 bytes"), std::string::npos);
  bad = good;
  bad.width = 0;
  EXPECT_FALSE(FromMessage(bad, {}));
  bad = good;
  bad.step = 4;
  EXPECT_FALSE(FromMessage(bad, {}));
  EXPECT_FALSE(FromMessage(good, {12, 0.01, 1.0}));  // 12 bits do not fit into mono8.
}

TEST(LensModelMessages, KeepEveryNumber) {
  const CameraModel model = sim::DefaultCalibration().projector;
  const auto back = FromMessage(ToMessage(model), "projector_info");
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back->width, model.width);
  EXPECT_EQ(back->height, model.height);
  EXPECT_EQ(back->fx, model.fx);
  EXPECT_EQ(back->fy, model.fy);
  EXPECT_EQ(back->cx, model.cx);
  EXPECT_EQ(back->cy, model.cy);
  EXPECT_EQ(back->distortion, model.distortion);
}

TEST(LensModelMessages, RefuseWhatIsNoLensModel) {
  sensor_msgs::CameraInfo message = ToMessage(sim::DefaultCalibration().camera);
  message.K[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(FromMessage(message, "camera_info"));
  message = ToMessage(sim::DefaultCalibration().camera);
  message.distortion_model = "equidistant";
  const auto refused = FromMessage(message, "camera_info");
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("'equidistant'"), std::string::npos);
}

TEST(TruthMessages, CarryEveryPixel) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  sim::ViewTruth truth;
  truth.points = Image<Eigen::Vector3f>(3, 2, Eigen::Vector3f::Constant(nan));
  truth.normals = truth.points;
  truth.u = Image<float>(3, 2, nan);
  truth.v = truth.u;
  truth.lit = Image<std::uint8_t>(3, 2, 0);
  truth.on_part = truth.lit;
  truth.points(2, 1) = {1.0F, 2.0F, 3.0F};
  truth.normals(2, 1) = {4.0F, 5.0F, 6.0F};
  truth.u(2, 1) = 7.0F;
  truth.v(2, 1) = 8.0F;
  truth.lit(2, 1) = 1;
  truth.on_part(1, 1) = 1;
  const sensor_msgs::PointCloud2 cloud = ToMessage(truth);
  EXPECT_EQ(cloud.width, 3U);
  EXPECT_EQ(cloud.height, 2U);
  ASSERT_EQ(cloud.fields.size(), 10U);
  ASSERT_EQ(cloud.data.size(), 6U * cloud.point_step);
  for (std::size_t k = 0; k < 8; ++k) {
    float value = 0.0F;
    std::memcpy(&value, &cloud.data[5 * cloud.point_step + cloud.fields[k].offset], sizeof(value));
    EXPECT_EQ(value, static_cast<float>(k + 1)) << cloud.fields[k].name;
    std::memcpy(&value, &cloud.data[cloud.fields[k].offset], sizeof(value));
    EXPECT_TRUE(std::isnan(value));
  }
  EXPECT_EQ(cloud.fields[8].name, "lit");
  EXPECT_EQ(cloud.data[5 * cloud.point_step + cloud.fields[8].offset], 1);
  EXPECT_EQ(cloud.data[5 * cloud.point_step + cloud.fields[9].offset], 0);
  EXPECT_EQ(cloud.data[4 * cloud.point_step + cloud.fields[9].offset], 1);
}

}  // namespace
}  // namespace fringe_fusion::ros_io
