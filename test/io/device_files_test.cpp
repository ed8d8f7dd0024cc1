#include "fringe_fusion/io/device_files.hpp"

#include <gtest/gtest.h>

#include "test/io/scan_fixture.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using test_support::MessageOf;
using test_support::Spit;
using test_support::TempFolder;

const char* const kPose =
    "T_base_flange: {translation_m: [1, 2, 3], quaternion_xyzw: [0, 0, 0, 1]}";

TEST(LoadRobotPoses, ReadsPosesOfItsOwnAndOfFiles) {
  const TempFolder folder;
  const std::string path = folder / "robot_poses.yaml";
  Spit(folder / "a.yaml", "{x: 0.5, y: 0, z: 0.25, qx: 1, qy: 0, qz: 0, qw: 0}\n");
  Spit(path, fmt::format("mount: eye_to_hand\nroot: .\nposes:\n"
                         "  - {{name: one, {}, view: 3, sigma_rotation_rad: 0.001,\n"
                         "     sigma_translation_m: 0.002}}\n"
                         "  - {{name: two, pose_file: a.yaml, image: b.png}}\n",
                         kPose));
  const auto file = LoadRobotPoses(path);
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->mount, HandEyeMount::kEyeToHand);
  ASSERT_EQ(file->stations.size(), 2U);
  EXPECT_EQ(file->stations[0].view, 3);
  EXPECT_EQ(file->stations[0].pose.T_base_flange.translation(), Eigen::Vector3d(1.0, 2.0, 3.0));
  EXPECT_DOUBLE_EQ(file->stations[0].pose.covariance(0, 0), 1e-6);
  EXPECT_DOUBLE_EQ(file->stations[0].pose.covariance(5, 5), 4e-6);
  EXPECT_EQ(file->stations[1].pose.T_base_flange.translation().z(), 0.25);
  EXPECT_EQ(file->stations[1].pose.T_base_flange.linear()(1, 1), -1.0);
  EXPECT_EQ(file->stations[1].pose.covariance.norm(), 0.0);
  EXPECT_EQ(file->stations[1].image, folder / "b.png");
}

TEST(LoadRobotPoses, SaysWhatIsWrong) {
  const TempFolder folder;
  const std::string path = folder / "robot_poses.yaml";
  const auto complaint = [&path](const std::string& text) {
    Spit(path, text);
    return MessageOf(LoadRobotPoses(path));
  };
  EXPECT_EQ(complaint("poses:\n  - {name: a}\n"),
            path + ": poses[0]: exactly one of T_base_flange and pose_file is needed");
  EXPECT_EQ(complaint(fmt::format("poses:\n  - {{name: a, {0}}}\n  - {{name: a, {0}}}\n", kPose)),
            path + ": poses[1]: the name 'a' occurs twice");
  EXPECT_EQ(complaint(fmt::format("poses:\n  - {{name: a, {}, sigma_rotation_rad: 1}}\n", kPose)),
            path + ": poses[0]: required key 'sigma_translation_m' is missing");
  EXPECT_EQ(complaint("posses: []\n"), path + ": required key 'poses' is missing");
  EXPECT_EQ(complaint("poses:\n  - {name: a, pose_file: nowhere.yaml}\n").find(folder / "nowhere"),
            0U);
}

TEST(LoadTurntableStops, ReadsAngles) {
  const TempFolder folder;
  const std::string path = folder / "stops.yaml";
  Spit(path,
       "stops:\n  - {name: a, angle_rad: 0.5}\n"
       "  - {name: b, angle_rad: 1, sigma_angle_rad: 0.001}\n");
  const auto stops = LoadTurntableStops(path);
  ASSERT_TRUE(stops) << stops.error().message;
  EXPECT_EQ(stops->at(0).sigma_angle_rad, 0.0);
  EXPECT_EQ(stops->at(1).sigma_angle_rad, 0.001);
  Spit(path, "stops:\n  - {name: a, angle: 0.5}\n");
  EXPECT_EQ(MessageOf(LoadTurntableStops(path)),
            path + ": stops[0]: required key 'angle_rad' is missing");
}

TEST(ReadRig, TakesACameraAlone) {
  const TempFolder folder;
  const std::string path = folder / "camera.yaml";
  Spit(path,
       "camera: {width: 640, height: 480, fx: 500, fy: 501, cx: 320, cy: 240, "
       "distortion: [0, 0, 0, 0, 0]}\n");
  const auto rig = ReadRig(path);
  ASSERT_TRUE(rig) << rig.error().message;
  EXPECT_EQ(rig->camera.fy, 501.0);
  EXPECT_EQ(rig->projector.width, 0);
  Spit(path, "camera: {width: 640}\n");
  EXPECT_EQ(MessageOf(ReadRig(path)), path + ": camera: required key 'height' is missing");
}

TEST(FrameEdges, SurviveARoundTripAndTakeResults) {
  const TempFolder folder;
  auto edges = ReadFrameEdges(SOURCE_DIR "/config/cell_sim/turntable_edges.yaml");
  ASSERT_TRUE(edges) << edges.error().message;
  ASSERT_EQ(edges->size(), 3U);
  const std::string path = folder / "edges.yaml";
  ASSERT_TRUE(WriteFrameEdges(*edges, path));
  const auto again = ReadFrameEdges(path);
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->at(0).name, "scanner");
  EXPECT_TRUE(again->at(0).T_parent_child.isApprox(edges->at(0).T_parent_child, 1e-14));

  HandEyeResult hand_eye;
  hand_eye.T_carrier_camera.translation().x() = 0.125;
  EXPECT_EQ(ScannerEdge(hand_eye, "tool0", "base").parent_frame, "tool0");
  hand_eye.mount = HandEyeMount::kEyeToHand;
  SetFrameEdge(ScannerEdge(hand_eye, "tool0", "cell"), *edges);
  EXPECT_EQ(edges->size(), 3U);
  EXPECT_EQ(edges->at(0).T_parent_child.translation().x(), 0.125);
  SetFrameEdge({"more", "cell", "more", Transform::Identity()}, *edges);
  EXPECT_EQ(edges->size(), 4U);

  // An axis that leans by a little: origin and x of the base stay as near as they can.
  TurntableResult table;
  table.T_camera_base.linear() = ExpRotation({0.01, 0.0, 2.0});
  table.T_camera_base.translation() = Eigen::Vector3d(0.003, 0.0, 0.4);
  const FrameEdge base = TurntableBaseEdge(table, Transform::Identity(), "cell", *edges);
  EXPECT_EQ(base.name, "turntable_base");
  EXPECT_LT(base.T_parent_child.translation().norm(), 0.02);
  EXPECT_GT(base.T_parent_child.linear()(0, 0), 0.999);
  EXPECT_TRUE(base.T_parent_child.linear().col(2).isApprox(table.T_camera_base.linear().col(2)));
}

TEST(FrameEdges, SayWhatIsWrong) {
  const TempFolder folder;
  const std::string path = folder / "edges.yaml";
  Spit(path,
       "names: [a]\na: {parent_frame: b, child_frame: c, translation_m: [0, 0, 0], "
       "quaternion_xyzw: [1, 1, 0, 0]}\n");
  EXPECT_EQ(MessageOf(ReadFrameEdges(path)).find(path + ": a: quaternion has length"), 0U);
  Spit(path,
       "names: [a, b]\na: {parent_frame: b, child_frame: c, translation_m: [0, 0, 0], "
       "quaternion_xyzw: [0, 0, 0, 1]}\n");
  EXPECT_EQ(MessageOf(ReadFrameEdges(path)), path + ": required key 'b' is missing");
}

}  // namespace
}  // namespace fringe_fusion
