// Hand-eye and turntable from sightings, scans and views, and the edges of the tf tree that they
// set; drift from one view.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/device_files.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"
#include "fringe_fusion/sim/target_plate.hpp"
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

/// The number behind "key": in the figures of a run.
double DeviceFigure(const std::string& json, const std::string& key) {
  const std::size_t at = json.find('"' + key + "\": ");
  EXPECT_NE(at, std::string::npos) << key;
  return at == std::string::npos ? std::nan("")
                                 : std::strtod(json.c_str() + at + key.size() + 4, nullptr);
}

/// Holds the axis that the figures of a run state against the true one, camera frame.
void ExpectAxis(const std::string& json, const Eigen::Vector3d& point,
                const Eigen::Vector3d& direction) {
  const auto figure = [&json](const std::string& key) { return DeviceFigure(json, key); };
  const Eigen::Vector3d found_point(figure("translation_m_x"), figure("translation_m_y"),
                                    figure("translation_m_z"));
  const Eigen::Quaterniond q(figure("quaternion_w"), figure("quaternion_x"), figure("quaternion_y"),
                             figure("quaternion_z"));
  const Eigen::Vector3d found = q * Eigen::Vector3d::UnitZ();
  EXPECT_LT(found.cross(direction).norm(), 5.0 * figure("sigma_direction_deg") / 57.3);
  EXPECT_GT(found.dot(direction), 0.9);
  EXPECT_LT((found_point - point).cross(direction).norm(), 5.0 * figure("sigma_point_m"));
}

TEST_F(DeviceCommands, TurntableFromOverlappingViews) {
  WriteSmallCellConfig(Path("config"));
  const Outcome simulated = RunFringe(
      {"simulate", "--config", Path("config/cell.yaml"), "--views", "8", "--out", Path("scan")});
  ASSERT_EQ(simulated.exit_status, 0) << simulated.err;
  const Outcome outcome = RunFringe({"turntable", "--views", Path("scan"), "--out",
                                     Path("table.yaml"), "--json", Path("t.json")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("accepted: 8 of 8 stops"), std::string::npos) << outcome.out;
  EXPECT_EQ(outcome.out.find("points"), std::string::npos) << outcome.out;
  EXPECT_TRUE(fs::exists(Path("table.yaml")));
  // The camera looks at a point of the axis from 0.5 m, 25 deg above the table.
  const double elevation = 25.0 / 57.29577951308232;
  ExpectAxis(ReadBytes(Path("t.json")), {0.0, 0.0, 0.5},
             {0.0, -std::cos(elevation), -std::sin(elevation)});
}

/// Renders a target that lies on a table before the camera, at five stops 20 deg apart.
void RenderTableScan(const CalibrationTarget& target, const Transform& T_camera_base,
                     const std::string& folder) {
  const auto calibration = ReadCellCalibration(SOURCE_DIR "/test/ros/cell_small.yaml");
  ASSERT_TRUE(calibration) << calibration.error().message;
  const sim::SurfacePrint print{MakeTargetPrint(target), Transform::Identity(), 1e-4};
  auto cell = sim::SimCell::Create(sim::SimConfig{}, *calibration, sim::MakeTargetPlate(print),
                                   Mesh{}, print);
  ASSERT_TRUE(cell) << cell.error().message;
  PatternConfig patterns;
  patterns.fringes = "1,6,36";
  const auto sequence =
      MakeSequence(patterns, calibration->projector.width, calibration->projector.height);
  ASSERT_TRUE(sequence) << sequence.error().message;
  const auto scan = CreateScan(folder, *calibration, *sequence);
  ASSERT_TRUE(scan) << scan.error().message;
  // Face up, its middle on the axis.
  const Transform T_table_target = test_support::TransformOf({180.0, 0.0, 0.0}, {-0.054, 0.036, 0});
  for (int k = 0; k < 5; ++k) {
    const double angle_rad = (20.0 * k - 40.0) * test_support::kRadPerDeg;
    const Transform T_camera_target =
        T_camera_base * Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ()) * T_table_target;
    ASSERT_TRUE(cell->MoveTo(T_camera_target.inverse(), k));
    const auto stack = sim::CaptureStack(*cell, *sequence, 1.0, 0.02, k);
    ASSERT_TRUE(stack) << stack.error().message;
    ASSERT_TRUE(WriteStack(*scan, *stack, std::nullopt, {angle_rad}));
  }
}

TEST_F(DeviceCommands, TurntableFromAScanOfATarget) {
  const std::string target_file = SOURCE_DIR "/config/cell_sim/target.yaml";
  const auto target = LoadTarget(target_file);
  ASSERT_TRUE(target) << target.error().message;
  const Transform T_camera_base = test_support::TransformOf({150.0, 0.0, 0.0}, {0.0, 0.0, 0.5});
  RenderTableScan(*target, T_camera_base, Path("scan"));
  std::vector<std::string> call = {"turntable",        "--dataset", Path("scan"),
                                   "--target",         target_file, "--out",
                                   Path("table.yaml"), "--json",    Path("t.json")};
  const Outcome outcome = RunFringe(call);
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("accepted: 5 of 5 stops over 80.0 deg"), std::string::npos)
      << outcome.out;
  EXPECT_NE(outcome.out.find("70 points"), std::string::npos) << outcome.out;
  ExpectAxis(ReadBytes(Path("t.json")), T_camera_base.translation(), T_camera_base.linear().col(2));
  call.insert(call.end(), {"--joint", "1"});
  EXPECT_NE(Refusal(call).find("view.yaml has 1 joint_positions, --joint 1 asks for one more"),
            std::string::npos);
}

class RecalibrateCommand : public DeviceCommands {
 protected:
  /// cell.yaml with a covariance, and one sighting of the cell as it is later.
  void WriteLater(const CellCalibration& later) const {
    CellCalibrationResult before;
    before.calibration = test_support::SceneCell();
    before.covariance.diagonal().head<4>().setConstant(0.04);
    before.covariance.diagonal().segment<4>(9).setConstant(0.04);
    before.covariance.diagonal().tail<6>().setConstant(1e-10);
    ASSERT_TRUE(WriteCalibratedCell(before, Path("cell.yaml")));
    const CalibrationTarget target = test_support::SceneTarget();
    SightingsFile file;
    file.target = target;
    const DeviceSizes sizes = test_support::SizesOf(later);
    file.camera_width = sizes.camera_width;
    file.camera_height = sizes.camera_height;
    file.projector_width = sizes.projector_width;
    file.projector_height = sizes.projector_height;
    file.sightings = {test_support::Sight(
        later, target, TargetPoints(target),
        test_support::ScenePose(target, {0.01, -0.02, 0.7}, 0.4, 1.0, 0.2), {}, "later")};
    ASSERT_TRUE(SaveSightings(file, Path("s.yaml")));
  }
  [[nodiscard]] std::vector<std::string> Call() const {
    return {"recalibrate", "--cell",         Path("cell.yaml"), "--sightings", Path("s.yaml"),
            "--out",       Path("now.yaml"), "--json",          Path("r.json")};
  }
};

TEST_F(RecalibrateCommand, FindsAProjectorThatTurned) {
  CellCalibration later = test_support::SceneCell();
  Vector6d moved;
  moved << 5e-4, -7e-4, 2e-4, 0.0, 0.0, 0.0;
  later.T_projector_camera = later.T_projector_camera * Exp(moved);
  WriteLater(later);
  const Outcome outcome = RunFringe(Call());
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("the cell has moved"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("told: "), std::string::npos) << outcome.out;
  const std::string json = ReadBytes(Path("r.json"));
  EXPECT_NE(json.find("\"has_moved\": true"), std::string::npos) << json;
  EXPECT_LT(DeviceFigure(json, "rms_after_px"), 0.2 * DeviceFigure(json, "rms_before_px"));
  const auto now = ReadCellCalibration(Path("now.yaml"));
  ASSERT_TRUE(now) << now.error().message;
  // Where the projector sees a point of the volume, before and after.
  const Eigen::Vector3d point(0.05, 0.03, 0.7);
  const auto pixel = [&point](const CellCalibration& cell) {
    return Project(cell.projector, cell.T_projector_camera * point);
  };
  const double before_px = (pixel(test_support::SceneCell()) - pixel(later)).norm();
  EXPECT_GT(before_px, 0.5);
  EXPECT_LT((pixel(*now) - pixel(later)).norm(), 0.1 * before_px);
  EXPECT_TRUE(ReadCellCovariance(Path("now.yaml")));
}

TEST_F(RecalibrateCommand, SaysWhatIsWrong) {
  EXPECT_NE(Refusal({"recalibrate", "--cell", Path("cell.yaml"), "--sightings", Path("s.yaml"),
                     "--out", Path("now.yaml")})
                .find("cell.yaml: cannot be read"),
            std::string::npos);
  WriteLater(test_support::SceneCell());
  EXPECT_NE(Refusal({"recalibrate", "--cell", Path("cell.yaml"), "--out", Path("now.yaml")})
                .find("exactly one of --dataset and --sightings"),
            std::string::npos);
  auto seen = LoadSightings(Path("s.yaml"));
  ASSERT_TRUE(seen) << seen.error().message;
  seen->sightings.push_back(seen->sightings.front());
  seen->sightings.back().name = "again";
  ASSERT_TRUE(SaveSightings(*seen, Path("s.yaml")));
  EXPECT_NE(Refusal(Call()).find("has 2 sightings, one is needed"), std::string::npos);
  ASSERT_TRUE(WriteCellCalibration(test_support::SceneCell(), Path("cell.yaml")));
  EXPECT_NE(Refusal(Call()).find("covariance"), std::string::npos) << Refusal(Call());
  EXPECT_FALSE(fs::exists(Path("now.yaml")));
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
