// Views, poses with covariance, clouds and markers on their way between core and messages.
#include "fringe_fusion/ros_io/view_messages.hpp"

#include <gtest/gtest.h>
#include <ros/serialization.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <random>

#include "fringe_fusion/ros_io/geometry_messages.hpp"
#include "fringe_fusion/ros_io/marker_messages.hpp"
#include "fringe_fusion/ros_io/octomap_message.hpp"
#include "fringe_fusion/ros_io/pose_prior.hpp"

namespace fringe_fusion::ros_io {
namespace {

Transform SomePose() {
  Vector6d xi;
  xi << 0.4, -1.1, 0.7, 0.3, -0.2, 0.5;
  return Exp(xi);
}

Matrix6d SomeCovariance() {
  std::mt19937 generator(7);
  std::normal_distribution<double> normal;
  Matrix6d A;
  for (int i = 0; i < 36; ++i) A.data()[i] = normal(generator);
  Vector6d scale;
  scale << 2e-3, 1e-3, 3e-3, 1e-3, 2e-3, 5e-4;
  return scale.asDiagonal() * (A * A.transpose() / 6.0) * scale.asDiagonal();
}

View SomeView() {
  View view;
  view.id = 5;
  view.range = MakeRangeImage(7, 4);
  for (int i = 0; i < 28; i += 3) {
    const auto at = static_cast<std::size_t>(i);
    const auto value = static_cast<float>(i);
    view.range.points[at] = {0.01F * value, -0.02F * value, 0.5F + 0.001F * value};
    view.range.normals[at] = Eigen::Vector3f(0.1F * value, 0.2F, -1.0F).normalized();
    view.range.color[at] = {static_cast<std::uint8_t>(i), 200, static_cast<std::uint8_t>(255 - i)};
    view.range.sigma_range[at] = 1e-5F * (1.0F + value);
    view.range.sigma_lateral[at] = 2e-5F * (1.0F + value);
  }
  view.range.line_of_sight.projector = Eigen::Vector3f(0.2F, 0.01F, 0.02F);
  view.range.first_stamp_ns = 1700000000123456789;
  view.range.last_stamp_ns = 1700000001000000001;
  view.pose.T_object_camera = SomePose();
  view.pose.covariance = SomeCovariance();
  view.pose.source = PoseSource::kTf;
  return view;
}

// Draws T Exp(xi) and measures the spread of what ROS's order means by its six numbers.
TEST(PoseCovariance, AgreesWithMonteCarlo) {
  const Transform T = SomePose();
  const Matrix6d core = SomeCovariance();
  const Matrix6d ros = ToRosCovariance(core, T);
  const Matrix6d root = core.llt().matrixL();
  std::mt19937 generator(11);
  std::normal_distribution<double> normal;
  constexpr int kNumDraws = 50000;
  Matrix6d sampled = Matrix6d::Zero();
  for (int i = 0; i < kNumDraws; ++i) {
    Vector6d z;
    for (int k = 0; k < 6; ++k) z[k] = normal(generator);
    const Transform drawn = T * Exp(root * z);
    Vector6d deviation;
    deviation.head<3>() = drawn.translation() - T.translation();
    // Rotation about the fixed axes of the parent frame: R_drawn = Exp(w) R.
    deviation.tail<3>() = LogRotation(drawn.linear() * T.linear().transpose());
    sampled += deviation * deviation.transpose() / kNumDraws;
  }
  for (int r = 0; r < 6; ++r) {
    for (int c = 0; c < 6; ++c) {
      const double limit = 0.03 * std::sqrt(ros(r, r) * ros(c, c));
      EXPECT_NEAR(sampled(r, c), ros(r, c), limit) << r << ", " << c;
    }
  }
  EXPECT_LT((FromRosCovariance(ros, T) - core).norm(), 1e-12 * core.norm());
}

TEST(PoseCovariance, RefusesNaN) {
  geometry_msgs::PoseWithCovariance message = ToMessage(SomeView().pose);
  message.covariance[7] = std::nan("");
  EXPECT_FALSE(FromMessage(message, "tf"));
  EXPECT_FALSE(FromMessage(ToMessage(SomeView().pose), "guess"));
}

// A turn of the object about its own z axis moves a distant camera, so the two are correlated.
TEST(PosePrior, TurntableErrorIsSeenFromTheCamera) {
  PosePriorConfig config;
  config.rotation_sigma_deg = {1e-5, 1e-5, 0.05};
  config.translation_sigma_mm = {1e-5, 1e-5, 1e-5};
  Transform T = Transform::Identity();
  T.translation() = Eigen::Vector3d(0.5, 0.0, 0.2);
  const Pose pose = PriorPose(T, config, PoseSource::kTf);
  const double sigma_rad = 0.05 * 3.14159265358979323846 / 180.0;
  EXPECT_NEAR(std::sqrt(pose.covariance(2, 2)), sigma_rad, 1e-9);
  EXPECT_NEAR(std::sqrt(pose.covariance(4, 4)), 0.5 * sigma_rad, 1e-6);
  EXPECT_NEAR(pose.covariance(2, 4), 0.5 * sigma_rad * sigma_rad, 1e-9);
}

TEST(ViewMessages, RoundTripKeepsEveryBit) {
  const View view = SomeView();
  const RangeView message = ToMessage(view, {"scan", "cal", "camera", "object"});
  EXPECT_EQ(message.header.frame_id, "camera");
  EXPECT_EQ(message.pose.header.frame_id, "object");
  EXPECT_EQ(message.calibration_id, "cal");
  const Result<View> back = FromMessage(message);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back->id, view.id);
  EXPECT_EQ(back->range.first_stamp_ns, view.range.first_stamp_ns);
  EXPECT_EQ(back->range.last_stamp_ns, view.range.last_stamp_ns);
  EXPECT_EQ(CountValid(back->range), CountValid(view.range));
  EXPECT_EQ(*back->range.line_of_sight.projector, *view.range.line_of_sight.projector);
  for (std::size_t i = 0; i < view.range.points.size(); i += 3) {
    EXPECT_EQ(back->range.points[i], view.range.points[i]);
    EXPECT_EQ(back->range.normals[i], view.range.normals[i]);
    EXPECT_EQ(back->range.color[i].b, view.range.color[i].b);
    EXPECT_EQ(back->range.sigma_range[i], view.range.sigma_range[i]);
    EXPECT_EQ(back->range.sigma_lateral[i], view.range.sigma_lateral[i]);
  }
  EXPECT_TRUE(back->pose.T_object_camera.isApprox(view.pose.T_object_camera, 1e-14));
  EXPECT_LT((back->pose.covariance - view.pose.covariance).norm(), 1e-18);
}

TEST(ViewMessages, RefusesMalformedClouds) {
  const sensor_msgs::PointCloud2 good = ToPointCloud(SomeView().range, "camera");
  auto cloud = good;
  cloud.data.pop_back();
  EXPECT_FALSE(FromPointCloud(cloud));
  cloud = good;
  cloud.fields[7].name = "sigma";
  const auto missing = FromPointCloud(cloud);
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().message.find("sigma_range"), std::string::npos);
  cloud = good;
  cloud.fields[8].offset = cloud.point_step - 2;
  EXPECT_FALSE(FromPointCloud(cloud));
  cloud = good;
  cloud.width = 0;
  EXPECT_FALSE(FromPointCloud(cloud));
}

TEST(Markers, LargeMeshIsThinnedAndStaysInPlace) {
  constexpr int kSide = 60;
  Mesh mesh;
  for (int y = 0; y <= kSide; ++y) {
    for (int x = 0; x <= kSide; ++x) {
      mesh.vertices.emplace_back(0.001F * static_cast<float>(x), 0.001F * static_cast<float>(y),
                                 0.0F);
    }
  }
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const int a = y * (kSide + 1) + x;
      mesh.faces.emplace_back(a, a + 1, a + kSide + 2);
      mesh.faces.emplace_back(a, a + kSide + 2, a + kSide + 1);
    }
  }
  EXPECT_EQ(ToMarker(mesh, std_msgs::Header(), 10000).points.size(), 3U * 7200U);
  const auto thin = ToMarker(mesh, std_msgs::Header(), 1000);
  EXPECT_LE(thin.points.size(), 3000U);
  EXPECT_GT(thin.points.size(), 600U);
  double largest = 0.0;
  for (const auto& point : thin.points) largest = std::max(largest, point.x);
  EXPECT_GT(largest, 0.055);
}

TEST(Octomap, IsTheSameOnTheWireAsOctomapMsgs) {
  OctomapMessage message;
  message.header.seq = 1;
  message.header.frame_id = "object";
  message.binary = 1;
  message.id = "OcTree";
  message.resolution = 0.25;
  message.data = {1, -2, 3};
  EXPECT_STREQ(ros::message_traits::md5sum<OctomapMessage>(), "9a45536b45c5e409cd49f04bb2d9999f");
  EXPECT_STREQ(ros::message_traits::datatype<OctomapMessage>(), "octomap_msgs/Octomap");
  // header (seq, stamp, string) + bool + string + float64 + int8[]
  EXPECT_EQ(ros::serialization::serializationLength(message),
            4U + 8U + (4U + 6U) + 1U + (4U + 6U) + 8U + (4U + 3U));
}

}  // namespace
}  // namespace fringe_fusion::ros_io
