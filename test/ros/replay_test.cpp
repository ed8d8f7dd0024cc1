// The small bag of the repository, which holds only frames, tf, camera_info and projector_info,
// through phase, pose and fusion: the gauge comes out, and twice the same bytes.
#include <fringe_fusion/ExtractSurface.h>
#include <fringe_fusion/OptimizeViews.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include "fringe_fusion/inspection/compare.hpp"
#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/ros_io/service_call.hpp"
#include "fringe_fusion/sim/gauges.hpp"
#include "test/ros/cell_support.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

constexpr std::uint32_t kNumViews = 3;
const char* const kBag = SOURCE_DIR "/test/data/small_scan.bag";

// Plays the bag once, from a clean start. @return words of what failed.
std::string Replay(const std::string& mesh_path) {
  const ros::NodeHandle nh;
  for (const char* service : {"pose_node/reset", "fusion_node/reset"}) {
    if (!ros::service::waitForService(service, ros::Duration(20.0))) return service;
    const auto reset =
        ros_io::CallService<std_srvs::Trigger>(nh, service, std_srvs::Trigger::Request(), 10.0);
    if (!reset) return reset.error().message;
  }
  test::Process player(
      {"rosrun", "rosbag", "play", "-q", "--delay=3", "--wait-for-subscribers", "--rate=3", kBag});
  OptimizeViews::Request optimize;
  optimize.num_views = kNumViews;
  optimize.timeout = ros::Duration(40.0);
  const auto poses = ros_io::CallService<OptimizeViews>(nh, "optimize_views", optimize, 60.0);
  if (!poses) return poses.error().message;
  ExtractSurface::Request extract;
  extract.path = mesh_path;
  extract.num_views = kNumViews;
  extract.pose_revision = poses->poses.revision;
  extract.timeout = ros::Duration(20.0);
  const auto surface = ros_io::CallService<ExtractSurface>(nh, "extract_mesh", extract, 30.0);
  if (!surface) return surface.error().message;
  return player.EndsWell(20.0) ? "" : "rosbag play failed";
}

TEST(Replay, GivesTheGaugeAndTwiceTheSameBytes) {
  const test_support::TempFolder folder;
  ASSERT_EQ(Replay(folder / "one.ply"), "");
  ASSERT_EQ(Replay(folder / "two.ply"), "");
  const Result<std::string> one = ReadFile(folder / "one.ply");
  const Result<std::string> two = ReadFile(folder / "two.ply");
  ASSERT_TRUE(one && two);
  EXPECT_TRUE(*one == *two) << one->size() << " and " << two->size() << " bytes";

  const Result<Mesh> mesh = ReadMesh(folder / "one.ply");
  ASSERT_TRUE(mesh) << mesh.error().message;
  const Result<Mesh> truth = sim::MakeObject("sphere");
  ASSERT_TRUE(truth) << truth.error().message;
  const Result<InspectionResult> inspection = Compare(*mesh, *truth, InspectionConfig());
  ASSERT_TRUE(inspection) << inspection.error().message;
  // 1.2 mm pixels, 0.2 mm pose errors.
  EXPECT_LT(inspection->model_to_reference.rms_m, 0.5e-3);
  EXPECT_GT(mesh->faces.size(), 500U);
}

}  // namespace
}  // namespace fringe_fusion

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "replay_test");
  const ros::NodeHandle nh;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
