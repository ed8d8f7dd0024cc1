// One view from end to end: move, project, capture, decode, triangulate; the cloud against truth.
// Run on the plain nodes, on nodelets, and with the camera behind GigE Vision.
#include <gtest/gtest.h>
#include <ros/ros.h>

#include <algorithm>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "test/ros/cell_support.hpp"

namespace fringe_fusion {
namespace {

TEST(OneView, CloudLiesOnTheTruth) {
  const test::ViewComparison view = test::ScanAndCompareView(0.7, 60.0);
  ASSERT_EQ(view.failure, "");
  EXPECT_GT(view.num_points, 2000U);
  RecordProperty("median_um", static_cast<int>(1e6 * view.median_m));
  RecordProperty("p95_um", static_cast<int>(1e6 * view.p95_m));
  EXPECT_LT(view.median_m, 0.05e-3);
  EXPECT_LT(view.p95_m, 0.15e-3);
  EXPECT_GT(view.complete_ratio, 0.8);
  std::string file;
  ASSERT_TRUE(ros::param::get("cell_sim_node/calibration_file", file));
  const Result<CellCalibration> calibration = ReadCellCalibration(file);
  ASSERT_TRUE(calibration) << calibration.error().message;
  EXPECT_EQ(view.calibration_id, CalibrationId(*calibration));
}

TEST(OneView, NoProductNodeListensToTheTruth) {
  const auto subscribers = test::Subscribers();
  ASSERT_GT(subscribers.count("/frames"), 0U) << "the graph is not there";
  const std::string self = ros::this_node::getName();
  for (const auto& [topic, nodes] : subscribers) {
    if (topic.find("truth") == std::string::npos) continue;
    for (const std::string& node : nodes) EXPECT_EQ(node, self) << "subscribes to " << topic;
  }
}

}  // namespace
}  // namespace fringe_fusion

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "one_view_test");
  const ros::NodeHandle nh;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
