// Hand-eye and turntable from sightings, and the edges of the tf tree that they set.
#include <gtest/gtest.h>

#include <cmath>

#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/device_files.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_program.hpp"
#include "test/calibration/device_scene.hpp"
#include "test/support/data_path.hpp"

namespace fringe_fusion::cli {
namespace {

namespace fs = std::filesystem;

std::string NumbersOf(const Eigen::Ref<const Eigen::VectorXd>& values) {
  std::string text;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    text += fmt::format("{}{:.17g}", i > 0 ? ", " : "", values[i]);
  }
  return "[" + text + "]";
}

std::string RobotPosesText(const std::vector<DevicePose>& poses, const std::string& mount) {
  std::string text = "mount: " + mount + "\nposes:\n";
  for (const DevicePose& pose : poses) {
    text += fmt::format(
        "  - name: {}\n    T_base_flange: {{translation_m: {}, quaternion_xyzw: {}}}\n"
        "    sigma_rotation_rad: 1.0e-4\n    sigma_translation_m: 2.0e-5\n",
        pose.name, NumbersOf(pose.T_base_flange.translation()),
        NumbersOf(QuaternionXyzw(pose.T_base_flange)));
  }
  return text;
}

class DeviceCommands : public ::testing::Test {
 protected:
  [[nodiscard]] std::string Path(const std::string& name) const {
    return (folder_ / name).string();
  }
  [[nodiscard]] static std::string Refusal(const std::vector<std::string>& arguments) {
    const Outcome outcome = RunFringe(arguments);
    EXPECT_NE(outcome.exit_status, 0);
    return outcome.err;
  }
  void WriteScene(const std::vector<Transform>& views) const {
    SightingsFile file;
    file.target = test_support::SceneTarget();
    const CellCalibration cell = test_support::SceneCell();
    file.camera_width = cell.camera.width;
    file.camera_height = cell.camera.height;
    file.projector_width = cell.projector.width;
    file.projector_height = cell.projector.height;
    file.sightings = test_support::SightAll(cell, file.target, views, {});
    ASSERT_TRUE(SaveSightings(file, Path("s.yaml")));
    ASSERT_TRUE(WriteCellCalibration(cell, Path("cell.yaml")));
  }
  void WriteRobot(int num) {
    const auto views = test_support::HandEyeViews(test_support::SceneTarget(), num, 4);
    WriteScene(views);
    WriteBytes(Path("robot.yaml"),
               RobotPosesText(test_support::ReadRobot(robot_, views, {1e-4, 2e-5}, 9),
                              HandEyeMountName(robot_.mount)));
  }
  [[nodiscard]] std::vector<std::string> HandEyeCall() const {
    return {"hand-eye",        "--poses",      Path("robot.yaml"),
            "--sightings",     Path("s.yaml"), "--cell",
            Path("cell.yaml"), "--out",        Path("hand_eye.yaml")};
  }

  TemporaryFolder folder_{"fringe_device_commands"};
  test_support::RobotScene robot_;
};

TEST_F(DeviceCommands, HandEyeSetsTheEdgeOfTheScanner) {
  WriteRobot(10);
  fs::copy_file(SOURCE_DIR "/config/cell_sim/arm_edges.yaml", Path("edges.yaml"));
  auto call = HandEyeCall();
  for (const char* more : {"--edges", "--json"}) {
    call.emplace_back(more);
    call.push_back(Path(std::string(more) == "--json" ? "h.json" : "edges.yaml"));
  }
  const Outcome outcome = RunFringe(call);
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("accepted: 10 of 10 poses"), std::string::npos) << outcome.out;
  EXPECT_NE(ReadBytes(Path("h.json")).find("\"accepted\": true"), std::string::npos);
  EXPECT_NE(ReadBytes(Path("hand_eye.yaml")).find("covariance_camera: ["), std::string::npos);
  const auto edges = ReadFrameEdges(Path("edges.yaml"));
  ASSERT_TRUE(edges) << edges.error().message;
  ASSERT_EQ(edges->size(), 2U);
  EXPECT_EQ(edges->front().parent_frame, "tool0");
  EXPECT_EQ(edges->front().child_frame, "scanner");
  EXPECT_LT(
      test_support::PerturbationTo(robot_.T_carrier_camera, edges->front().T_parent_child).norm(),
      5e-4);
  EXPECT_EQ(edges->back().child_frame, "object");
}

TEST_F(DeviceCommands, HandEyeOfARobotThatHoldsTheTarget) {
  robot_.mount = HandEyeMount::kEyeToHand;
  WriteRobot(8);
  auto call = HandEyeCall();
  call.insert(call.end(), {"--edges", Path("new_edges.yaml"), "--base-frame", "base"});
  const Outcome outcome = RunFringe(call);
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const auto edges = ReadFrameEdges(Path("new_edges.yaml"));
  ASSERT_TRUE(edges) << edges.error().message;
  EXPECT_EQ(edges->front().parent_frame, "base");
}

TEST_F(DeviceCommands, HandEyeKeepsTheEarlierFileWhenItRejects) {
  WriteRobot(8);
  WriteBytes(Path("config/hand_eye.yaml"), "max_error_m: 1.0e-7\n");
  WriteBytes(Path("hand_eye.yaml"), "earlier");
  auto call = HandEyeCall();
  call.insert(call.end(), {"--config", Path("config")});
  EXPECT_NE(Refusal(call).find("predicted error of a point at the target"), std::string::npos);
  EXPECT_EQ(ReadBytes(Path("hand_eye.yaml")), "earlier");
  call.emplace_back("--force");
  EXPECT_EQ(RunFringe(call).exit_status, 0);
  EXPECT_NE(ReadBytes(Path("hand_eye.yaml")), "earlier");
}

TEST_F(DeviceCommands, HandEyeSaysWhatIsWrong) {
  EXPECT_NE(
      Refusal({"hand-eye", "--out", Path("h.yaml")}).find("exactly one of --dataset and --poses"),
      std::string::npos);
  WriteRobot(3);
  EXPECT_NE(Refusal(HandEyeCall()).find("3 of 3 poses are usable, 4 are needed"),
            std::string::npos);
  ReplaceInFile(Path("robot.yaml"), "name: pose 1", "name: nowhere");
  EXPECT_NE(Refusal(HandEyeCall()).find("has no sighting named 'nowhere'"), std::string::npos);
  ReplaceInFile(Path("robot.yaml"), "mount: eye_in_hand", "mount: hand");
  EXPECT_NE(Refusal(HandEyeCall()).find("mount 'hand' must be eye_in_hand or eye_to_hand"),
            std::string::npos);
  ReplaceInFile(Path("robot.yaml"), "mount: hand", "mount: eye_in_hand");
  ReplaceInFile(Path("robot.yaml"), "T_base_flange", "T_flange_base");
  const std::string refusal = Refusal(HandEyeCall());
  EXPECT_NE(refusal.find("poses[0]: exactly one of T_base_flange and pose_file is needed"),
            std::string::npos)
      << refusal;
  EXPECT_FALSE(fs::exists(Path("hand_eye.yaml")));
}

TEST_F(DeviceCommands, HandEyeReadsRealPictures) {
  const std::string data = test_support::DataPath("handeye_10x10");
  FRINGE_FUSION_REQUIRE_DATA(data);
  WriteBytes(Path("config/hand_eye.yaml"), "sigma_translation_mm: 1.0\nsigma_rotation_deg: 0.1\n");
  const Outcome outcome =
      RunFringe({"hand-eye", "--dataset", SOURCE_DIR "/config/datasets/handeye_10x10", "--config",
                 Path("config"), "--out", Path("hand_eye.yaml"), "--force"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("of 15 poses"), std::string::npos) << outcome.out;
}

TEST_F(DeviceCommands, TurntableSetsTheEdgeOfItsBase) {
  const test_support::TableScene table;
  const auto stops = test_support::TableStops(9, 360.0);
  WriteScene(table.TargetsAt(test_support::AnglesOfStops(stops), 1e-5, 2e-6, 1e-4, 3));
  std::string text = "stops:\n";
  for (const TurntableStop& stop : stops) {
    text += fmt::format("  - {{name: pose {}, angle_rad: {:.17g}}}\n", stop.name.substr(5),
                        stop.angle_rad);
  }
  WriteBytes(Path("stops.yaml"), text);
  fs::copy_file(SOURCE_DIR "/config/cell_sim/turntable_edges.yaml", Path("edges.yaml"));
  const std::vector<std::string> call = {
      "turntable",        "--sightings",     Path("s.yaml"), "--stops",          Path("stops.yaml"),
      "--cell",           Path("cell.yaml"), "--out",        Path("table.yaml"), "--edges",
      Path("edges.yaml"), "--json",          Path("t.json")};
  const Outcome outcome = RunFringe(call);
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("accepted: 9 of 9 stops"), std::string::npos) << outcome.out;
  EXPECT_NE(ReadBytes(Path("table.yaml")).find("covariance_base: ["), std::string::npos);
  const auto edges = ReadFrameEdges(Path("edges.yaml"));
  ASSERT_TRUE(edges) << edges.error().message;
  ASSERT_EQ(edges->size(), 3U);
  const FrameEdge& base = edges->at(1);
  EXPECT_EQ(base.name, "turntable_base");
  const Eigen::Vector3d expected =
      edges->front().T_parent_child.linear() * table.T_camera_base.linear().col(2);
  EXPECT_GT(base.T_parent_child.linear().col(2).dot(expected), 1.0 - 1e-7);
  // Its origin is the foot of the old one on the axis.
  EXPECT_NEAR(base.T_parent_child.translation().dot(expected), 0.0, 1e-3);
}

TEST_F(DeviceCommands, TurntableSaysWhatIsWrong) {
  EXPECT_NE(Refusal({"turntable", "--out", Path("t.yaml")})
                .find("exactly one of --dataset, --views and --sightings"),
            std::string::npos);
  EXPECT_NE(Refusal({"turntable", "--sightings", Path("s.yaml"), "--out", Path("t.yaml")})
                .find("--sightings needs --stops and --cell"),
            std::string::npos);
  EXPECT_FALSE(fs::exists(Path("t.yaml")));
}

}  // namespace
}  // namespace fringe_fusion::cli
