// What goes wrong in a cell: each fault ends in clear words, nothing hangs, the next scan works.
#include <fringe_fusion/StageState.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <signal.h>

#include <atomic>
#include <cmath>
#include <filesystem>
#include <mutex>

#include "fringe_fusion/io/mesh_io.hpp"
#include "test/ros/cell_support.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using test_support::TempFolder;

/// Sends scan_object goals and hears what comes of them.
class Cell {
 public:
  Cell() : client_("scan_object", true) {
    EXPECT_TRUE(test::WaitForCell(60.0));
    EXPECT_TRUE(test::WaitFor([this] { return client_.isServerConnected(); }, 30.0));
  }
  void Start(const TempFolder& folder, std::uint32_t num_views, bool resume) {
    ScanObjectGoal goal;
    goal.num_views = num_views;
    goal.output_folder = folder / "out";
    goal.resume = static_cast<std::uint8_t>(resume);
    state_.clear();
    client_.sendGoal(goal, ScanObjectClient::SimpleDoneCallback(),
                     ScanObjectClient::SimpleActiveCallback(),
                     [this](const ScanObjectFeedbackConstPtr& feedback) {
                       const std::lock_guard<std::mutex> lock(mutex_);
                       state_ = feedback->state;
                     });
  }
  /// Waits until the feedback says so.
  bool Reaches(const std::string& state) {
    return test::WaitFor(
        [&] {
          const std::lock_guard<std::mutex> lock(mutex_);
          return state_.find(state) != std::string::npos;
        },
        60.0);
  }
  std::string End(double timeout_s) { return test::WaitForEnd(client_, timeout_s); }
  std::string Message() { return client_.getResult() ? client_.getResult()->message : ""; }
  void Cancel() { client_.cancelGoal(); }
  void ExpectMesh(const TempFolder& folder, std::uint32_t num_views) {
    EXPECT_EQ(End(90.0), "SUCCEEDED") << Message();
    EXPECT_EQ(client_.getResult()->num_views, num_views);
    const Result<Mesh> mesh = ReadMesh(folder / "out/mesh.ply");
    ASSERT_TRUE(mesh) << mesh.error().message;
    EXPECT_GT(mesh->faces.size(), 1000U);
  }

 private:
  using ScanObjectClient = test::ScanObjectClient;
  ScanObjectClient client_;
  std::mutex mutex_;
  std::string state_;
};

/// The state of the turntable heard last.
class Turntable {
 public:
  Turntable() {
    ros::NodeHandle nh;
    subscriber_ = nh.subscribe<sensor_msgs::JointState>(
        "joint_states", 10, [this](const sensor_msgs::JointState::ConstPtr& message) {
          velocity_ = std::abs(message->velocity.at(0));
          position_ = message->position.at(0);
        });
  }
  [[nodiscard]] double Velocity() const { return velocity_; }
  [[nodiscard]] double Position() const { return position_; }

 private:
  std::atomic<double> velocity_{0.0};
  std::atomic<double> position_{0.0};
  ros::Subscriber subscriber_;
};

TEST(Faults, MissingDeviceIsNamed) {
  test::ScanViewClient scan("/alone/scan_view", true);
  ASSERT_TRUE(test::WaitFor([&] { return scan.isServerConnected(); }, 30.0));
  scan.sendGoal(ScanViewGoal());
  ASSERT_EQ(test::WaitForEnd(scan, 20.0), "ABORTED");
  EXPECT_NE(scan.getResult()->message.find("/alone/projector_node/load_sequence is not there"),
            std::string::npos)
      << scan.getResult()->message;
}

TEST(Faults, CancelStopsTheMotionAndTheScanCanBeResumed) {
  const TempFolder folder;
  Cell cell;
  const Turntable turntable;
  cell.Start(folder, 3, false);
  ASSERT_TRUE(cell.Reaches("moving to view 1"));
  ASSERT_TRUE(test::WaitFor([&] { return turntable.Velocity() > 0.1; }, 5.0));
  cell.Cancel();
  EXPECT_EQ(cell.End(10.0), "PREEMPTED") << cell.Message();
  EXPECT_TRUE(test::WaitFor([&] { return turntable.Velocity() == 0.0; }, 1.0));
  ros::WallDuration(0.5).sleep();
  EXPECT_EQ(turntable.Velocity(), 0.0);
  EXPECT_LT(turntable.Position(), 1.9) << "[rad]: it went on to its goal of 2/3 pi";
  EXPECT_TRUE(std::filesystem::exists(folder / "out/scan/views/000/view.yaml"));

  // A second scan into the same folder would mix two scans.
  cell.Start(folder, 3, false);
  EXPECT_EQ(cell.End(20.0), "ABORTED");
  EXPECT_NE(cell.Message().find("holds 1 views already"), std::string::npos) << cell.Message();

  cell.Start(folder, 3, true);
  cell.ExpectMesh(folder, 3);
}

TEST(Faults, SilentCameraEndsTheScanInWords) {
  const TempFolder folder;
  Cell cell;
  const pid_t camera = test::NodePid("/camera_node");
  ASSERT_GT(camera, 0);
  cell.Start(folder, 2, false);
  ASSERT_TRUE(cell.Reaches("capturing view 1"));
  ASSERT_EQ(kill(camera, SIGSTOP), 0);
  const std::string state = cell.End(30.0);
  kill(camera, SIGCONT);
  EXPECT_EQ(state, "ABORTED");
  EXPECT_NE(cell.Message().find("/camera_node/capture has not answered within"), std::string::npos)
      << cell.Message();
  cell.Start(folder, 2, true);
  cell.ExpectMesh(folder, 2);
}

TEST(Faults, KilledFusionNodeIsFedFromDisk) {
  const TempFolder folder;
  Cell cell;
  std::atomic<std::size_t> num_held{0};
  ros::NodeHandle nh;
  const ros::Subscriber model = nh.subscribe<StageState>(
      "model_state", 10, [&](const StageState::ConstPtr& m) { num_held = m->view_ids.size(); });
  const pid_t fusion = test::NodePid("/fusion_node");
  ASSERT_GT(fusion, 0);
  cell.Start(folder, 3, false);
  ASSERT_TRUE(cell.Reaches("view 1"));
  ASSERT_TRUE(test::WaitFor([&] { return num_held >= 1; }, 30.0));
  ASSERT_EQ(kill(fusion, SIGKILL), 0);
  const ros::WallTime killed = ros::WallTime::now();
  EXPECT_TRUE(cell.Reaches("from disk"));
  EXPECT_LT((ros::WallTime::now() - killed).toSec(), 15.0)
      << "the loss was not noticed; only process_timeout_s, 20 s, made the cell send again";
  cell.ExpectMesh(folder, 3);
}

}  // namespace
}  // namespace fringe_fusion

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "faults_test");
  const ros::NodeHandle nh;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
