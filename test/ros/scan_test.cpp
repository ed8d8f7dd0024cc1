// A turntable scan through scan_object: the mesh against truth, and the same mesh from its bag.
#include <fringe_fusion/ExtractSurface.h>
#include <fringe_fusion/OptimizeViews.h>
#include <fringe_fusion/ReadModel.h>
#include <fringe_fusion/WriteModel.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include <algorithm>
#include <memory>

#include "fringe_fusion/inspection/compare.hpp"
#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/io/poses_conf.hpp"
#include "fringe_fusion/ros_io/service_call.hpp"
#include "fringe_fusion/sim/gauges.hpp"
#include "test/ros/cell_support.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

constexpr std::uint32_t kNumViews = 6;

/// One scan, recorded; shared by the tests of this program.
class Scan : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    ASSERT_TRUE(test::WaitForCell(60.0));
    folder_ = std::make_unique<test_support::TempFolder>();
    test::Process recorder({"rosrun", "rosbag", "record", "-q", "-O", *folder_ / "scan.bag",
                            "/frames", "/tf", "/tf_static", "/camera_info", "/projector_info"});
    ASSERT_TRUE(test::WaitFor(
        [] {
          const auto subscribers = test::Subscribers();
          if (subscribers.count("/frames") == 0) return false;
          for (const std::string& node : subscribers.at("/frames")) {
            if (node.find("/record") == 0) return true;
          }
          return false;
        },
        30.0));
    test::ScanObjectClient client("scan_object", true);
    ASSERT_TRUE(test::WaitFor([&] { return client.isServerConnected(); }, 30.0));
    ScanObjectGoal goal;
    goal.scan_id = "rostest";
    goal.num_views = kNumViews;
    goal.output_folder = folder_->path();
    client.sendGoal(goal);
    const std::string state = test::WaitForEnd(client, 120.0);
    ASSERT_EQ(state, "SUCCEEDED") << (client.getResult() ? client.getResult()->message : "");
    result_ = *client.getResult();
    ASSERT_TRUE(recorder.Interrupt(20.0));
    scanned_ = true;
  }
  // A failure above only skips the tests, which would count as passed.
  void SetUp() override { ASSERT_TRUE(scanned_) << "the scan itself failed"; }
  static void TearDownTestSuite() { folder_.reset(); }

  static std::unique_ptr<test_support::TempFolder> folder_;
  static ScanObjectResult result_;
  static bool scanned_;
};
std::unique_ptr<test_support::TempFolder> Scan::folder_;
ScanObjectResult Scan::result_;
bool Scan::scanned_ = false;

TEST_F(Scan, MeshLiesOnTheTruth) {
  EXPECT_EQ(result_.num_views, kNumViews);
  EXPECT_LT(result_.rms_after, result_.rms_before);
  const Result<Mesh> mesh = ReadMesh(*folder_ / "mesh.ply");
  ASSERT_TRUE(mesh) << mesh.error().message;
  const Result<Mesh> truth = sim::MakeObject("freeform");
  ASSERT_TRUE(truth) << truth.error().message;
  const Result<InspectionResult> inspection = Compare(*mesh, *truth, InspectionConfig());
  ASSERT_TRUE(inspection) << inspection.error().message;
  // 0.6 mm pixels and 0.2 mm pose errors that registration shares out over six views.
  EXPECT_LT(inspection->model_to_reference.rms_m, 0.4e-3);
  EXPECT_LT(inspection->model_to_reference.p95_abs_m, 0.8e-3);
  EXPECT_GT(inspection->reference_to_model.count, inspection->reference_to_model.num_far);
}

TEST_F(Scan, LeavesPosesAndFigures) {
  for (const char* name : {"poses.conf", "poses_prior.conf"}) {
    const auto poses = ReadPosesConf(*folder_ / name);
    ASSERT_TRUE(poses) << poses.error().message;
    EXPECT_EQ(poses->size(), kNumViews);
  }
  const Result<std::string> figures = ReadFile(*folder_ / "figures.json");
  ASSERT_TRUE(figures) << figures.error().message;
  EXPECT_NE(figures->find(fmt::format("\"num_points\": {}", result_.num_points)),
            std::string::npos);
}

TEST_F(Scan, ReportsTheCaptureOfEveryView) {
  for (const CaptureFinding& finding : result_.findings) {
    ADD_FAILURE() << "view " << finding.view_id << ": " << finding.name << ": " << finding.evidence;
  }
  const Result<std::string> report = ReadFile(*folder_ / "report.html");
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_NE(report->find("<h2>Capture</h2>"), std::string::npos);
  EXPECT_NE(report->find(fmt::format("<td>{:03}</td><td>none</td>", kNumViews - 1)),
            std::string::npos);
}

TEST_F(Scan, ReplayOfTheBagGivesTheSameBytes) {
  // The delay: the player waits for one subscriber of tf, but two nodes need it from the start.
  test::Process player({"rosrun", "rosbag", "play", "-q", "--prefix=/replay", "--delay=3",
                        "--wait-for-subscribers", "--rate=4", *folder_ / "scan.bag"});
  const ros::NodeHandle nh("/replay");
  OptimizeViews::Request optimize;
  optimize.num_views = kNumViews;
  optimize.timeout = ros::Duration(90.0);
  const auto poses = ros_io::CallService<OptimizeViews>(nh, "optimize_views", optimize, 120.0);
  ASSERT_TRUE(poses) << poses.error().message;
  ExtractSurface::Request extract;
  extract.path = *folder_ / "replayed.ply";
  extract.num_views = kNumViews;
  extract.pose_revision = poses->poses.revision;
  extract.timeout = ros::Duration(30.0);
  const auto surface = ros_io::CallService<ExtractSurface>(nh, "extract_mesh", extract, 60.0);
  ASSERT_TRUE(surface) << surface.error().message;
  const Result<std::string> live = ReadFile(*folder_ / "mesh.ply");
  const Result<std::string> replayed = ReadFile(*folder_ / "replayed.ply");
  ASSERT_TRUE(live && replayed);
  EXPECT_GT(live->size(), 100000U);
  EXPECT_TRUE(*live == *replayed) << "mesh of the live scan: " << live->size()
                                  << " bytes, of the replay: " << replayed->size();
}

TEST_F(Scan, ASavedModelGoesOnInAnotherNode) {
  const ros::NodeHandle nh;
  const ros::NodeHandle other("/replay");
  WriteModel::Request write;
  write.path = *folder_ / "model.vdb";
  const auto saved = ros_io::CallService<WriteModel>(nh, "save_model", write, 60.0);
  ASSERT_TRUE(saved) << saved.error().message;
  EXPECT_EQ(saved->num_views, kNumViews);
  ASSERT_TRUE(ros_io::CallService<std_srvs::Trigger>(other, "fusion_node/reset",
                                                     std_srvs::Trigger::Request(), 10.0));
  ReadModel::Request read;
  read.path = write.path;
  const auto loaded = ros_io::CallService<ReadModel>(other, "load_model", read, 60.0);
  ASSERT_TRUE(loaded) << loaded.error().message;
  EXPECT_EQ(loaded->scan_id, "rostest");
  // What cannot be read leaves the model as it is.
  read.path = *folder_ / "absent.vdb";
  const auto absent = ros_io::CallService<ReadModel>(other, "load_model", read, 60.0);
  ASSERT_FALSE(absent);
  EXPECT_NE(absent.error().message.find("absent.vdb"), std::string::npos) << absent.error().message;
  ExtractSurface::Request extract;
  extract.path = *folder_ / "loaded.ply";
  extract.num_views = kNumViews;
  const auto surface = ros_io::CallService<ExtractSurface>(other, "extract_mesh", extract, 60.0);
  ASSERT_TRUE(surface) << surface.error().message;
  const Result<std::string> live = ReadFile(*folder_ / "mesh.ply");
  const Result<std::string> again = ReadFile(extract.path);
  ASSERT_TRUE(live && again);
  EXPECT_TRUE(*live == *again);
  // What the views of a loaded model saw as empty is lost with them.
  extract.watertight = 1;
  const auto closed = ros_io::CallService<ExtractSurface>(other, "extract_mesh", extract, 60.0);
  ASSERT_FALSE(closed);
  EXPECT_NE(closed.error().message.find("came with a saved model"), std::string::npos)
      << closed.error().message;
}

TEST_F(Scan, ClosesHolesOnRequest) {
  const ros::NodeHandle nh;
  ExtractSurface::Request extract;
  extract.path = *folder_ / "closed.ply";
  extract.num_views = kNumViews;
  extract.watertight = 1;
  const auto surface = ros_io::CallService<ExtractSurface>(nh, "extract_mesh", extract, 60.0);
  ASSERT_TRUE(surface) << surface.error().message;
  EXPECT_GT(surface->num_filled_faces, 0U);
  const Result<Mesh> mesh = ReadMesh(extract.path);
  ASSERT_TRUE(mesh) << mesh.error().message;
  EXPECT_EQ(std::count(mesh->filled_faces.begin(), mesh->filled_faces.end(), 1),
            static_cast<std::ptrdiff_t>(surface->num_filled_faces));
}

}  // namespace
}  // namespace fringe_fusion

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "scan_test");
  const ros::NodeHandle nh;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
