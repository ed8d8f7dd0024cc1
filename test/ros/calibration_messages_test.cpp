// Calibrations as messages and markers.
#include "fringe_fusion/ros_io/calibration_messages.hpp"

#include <gtest/gtest.h>

namespace fringe_fusion {
namespace {

using visualization_msgs::Marker;

/// One pose that takes part, one that was left out; numbers are made up.
CellCalibrationResult SomeCalibration() {
  CellCalibrationResult result;
  result.calibration.camera = {640, 480, 800.0, 800.0, 319.5, 239.5, {}};
  result.calibration.projector = {1280, 800, 1600.0, 1600.0, 639.5, 399.5, {}};
  // Looks along the camera's -x: its x axis is the camera's z axis.
  result.calibration.T_projector_camera.linear() << 0, 0, 1, 0, 1, 0, -1, 0, 0;
  result.calibration.T_projector_camera.translation() = Eigen::Vector3d(0.0, 0.0, 0.4);
  result.covariance(4, 4) = 0.04;
  result.target_points = {{0.0, 0.0, 0.0}, {0.1, 0.0, 0.0}, {0.1, 0.05, 0.0}};
  result.stage_shifts_m.assign(2, Eigen::Vector3d::Zero());
  PoseOutcome used;
  used.name = "a";
  used.used = true;
  used.T_camera_target = Transform(Eigen::Translation3d(0.0, 0.0, 0.5));
  used.covariance = 1e-6 * Matrix6d::Identity();
  used.num_points_camera = 2;
  used.rms_camera_px = 0.1;
  PoseOutcome left_out;
  left_out.name = "b";
  left_out.reason = "mirrored";
  result.poses = {used, left_out};
  result.residuals = {{0, 1, false, {400.0, 240.0}, {0.8, 0.0}},
                      {0, 1, true, {640.0, 400.0}, {1.6, 0.0}}};
  result.coverage.camera_ratio = 0.25;
  result.next.words = "nearer";
  result.next.error_before_m = 1e-4;
  result.next.T_camera_target = Transform(Eigen::Translation3d(0.0, 0.0, 0.4));
  result.verdict.accepted = true;
  result.verdict.words = "accepted";
  return result;
}

std_msgs::Header CameraHeader() {
  std_msgs::Header header;
  header.frame_id = "camera";
  return header;
}

TEST(CalibrationState, CarriesAResult) {
  const CalibrationState state = ros_io::ToMessage(SomeCalibration(), CameraHeader());
  EXPECT_EQ(state.header.frame_id, "camera");
  ASSERT_EQ(state.poses.size(), 2U);
  EXPECT_EQ(state.poses[0].pose.pose.position.z, 0.5);
  EXPECT_DOUBLE_EQ(state.poses[0].pose.covariance[0], 1e-6);
  EXPECT_TRUE(state.poses[0].used);
  EXPECT_EQ(state.poses[1].reason, "mirrored");
  EXPECT_TRUE(state.solved && state.acceptable);
  ASSERT_EQ(state.residuals.size(), 2U);
  EXPECT_FLOAT_EQ(state.residuals[0].residual_x, 0.8F);
  EXPECT_TRUE(state.residuals[1].in_projector);
  ASSERT_EQ(state.sigmas.size(), 24U);
  EXPECT_DOUBLE_EQ(state.sigmas[4], 0.2);
  EXPECT_EQ(state.parameters[4], "camera k1");
  EXPECT_EQ(state.values[0], 800.0);
  EXPECT_EQ(state.coverage_camera, 0.25);
  EXPECT_EQ(state.predicted_error, 1e-4);
  EXPECT_EQ(state.next_target_pose.position.z, 0.4);
}

TEST(CalibrationState, SaysWhatIsMissingBeforeASolution) {
  TargetSighting sighting;
  sighting.name = "a";
  sighting.points.resize(3);
  sighting.points[1].has_projector = true;
  Coverage coverage;
  coverage.camera_ratio = 0.1;
  coverage.gaps = "the upper left is empty";
  const auto state = ros_io::ToMessage({sighting}, coverage, "too few", CameraHeader());
  EXPECT_FALSE(state.solved);
  EXPECT_EQ(state.verdict, "too few");
  ASSERT_EQ(state.poses.size(), 1U);
  EXPECT_EQ(state.poses[0].num_points_camera, 3U);
  EXPECT_EQ(state.poses[0].num_points_projector, 1U);
  EXPECT_NE(state.next_pose.find("the upper left is empty"), std::string::npos);
}

TEST(CalibrationMarkers, ShowPosesResidualsAndTheNextPose) {
  const auto array = ros_io::ToMarkers(SomeCalibration(), CameraHeader(), 100.0);
  ASSERT_EQ(array.markers.size(), 5U);
  EXPECT_EQ(array.markers[0].action, Marker::DELETEALL);
  const Marker& poses = array.markers[1];
  ASSERT_EQ(poses.points.size(), 20U) << "four sides and a line to the middle, for each pose";
  EXPECT_GT(poses.colors.front().g, poses.colors.front().r);
  EXPECT_GT(poses.colors.back().r, poses.colors.back().g);
  const Marker& residuals = array.markers[2];
  ASSERT_EQ(residuals.points.size(), 4U);
  // 0.8 px of 800 px at 0.5 m are 0.5 mm, a hundred times enlarged.
  EXPECT_NEAR(residuals.points[0].x, 0.1, 1e-12);
  EXPECT_NEAR(residuals.points[1].x - residuals.points[0].x, 0.05, 1e-12);
  // The point (0.1, 0, 0.5) lies 0.3 m before the projector; its x is the camera's z.
  EXPECT_NEAR(residuals.points[3].z - residuals.points[2].z, 100.0 * 1.6 / 1600.0 * 0.3, 1e-12);
  EXPECT_NEAR(residuals.points[3].x, residuals.points[2].x, 1e-12);
  EXPECT_EQ(array.markers[4].text, "nearer");
  EXPECT_EQ(ros_io::NoMarkers(CameraHeader()).markers.size(), 1U);
}

}  // namespace
}  // namespace fringe_fusion
