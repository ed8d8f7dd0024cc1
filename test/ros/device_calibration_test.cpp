// Hand-eye and turntable by calibration_node: the simulation knows where its camera really is, tf
// does not until the result is accepted.
#include <fringe_fusion/CalibrateHandEyeAction.h>
#include <fringe_fusion/CalibrateTurntableAction.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

#include <atomic>
#include <cmath>
#include <functional>

#include "fringe_fusion/io/device_files.hpp"
#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"
#include "fringe_fusion/ros_io/tf_lookup.hpp"
#include "test/ros/cell_support.hpp"

namespace fringe_fusion {
namespace {

constexpr double kTimeout_s = 60.0;

/// What a step ended with.
template <typename Result_>
struct Ended {
  std::string state;
  Result_ result;
};

/// A calibration action, the axes, and tf.
template <typename Action>
class DeviceCell {
 public:
  using ActionResult = typename Action::_action_result_type::_result_type;

  /// @param start_edges what scanner_node starts with.
  /// @param true_camera edge to the frame of the simulated camera.
  DeviceCell(const std::string& action, const std::string& start_edges,
             const geometry_msgs::TransformStamped& true_camera)
      : client_(action, true), move_("move_to_view", true), listener_(tf_) {
    broadcaster_.sendTransform(true_camera);
    EXPECT_TRUE(ros::param::get("calibration_node/edges_file", edges_file_));
    // A run before this one has replaced them.
    const auto start = ReadFrameEdges(start_edges);
    EXPECT_TRUE(start && WriteFrameEdges(*start, edges_file_));
    EXPECT_TRUE(test::WaitFor(
        [this] {
          for (const char* name :
               {"cell_sim_node/expose", "projector_node/show_pattern", "camera_node/capture"}) {
            if (!ros::service::exists(ros::names::resolve(name), false)) return false;
          }
          return client_.isServerConnected() && move_.isServerConnected() &&
                 tf_.canTransform("object", "camera_optical_frame", ros::Time());
        },
        kTimeout_s));
  }

  Ended<ActionResult> Run(const std::string& step, const std::string& pose = "") {
    typename Action::_action_goal_type::_goal_type goal;
    goal.step = step;
    goal.pose = pose;
    client_.sendGoal(goal);
    Ended<ActionResult> ended;
    ended.state = test::WaitForEnd(client_, kTimeout_s);
    if (client_.getResult()) ended.result = *client_.getResult();
    return ended;
  }

  /// A step, and something else as soon as it captures.
  Ended<ActionResult> RunBeside(const std::string& step, const std::function<void()>& beside) {
    typename Action::_action_goal_type::_goal_type goal;
    goal.step = step;
    std::atomic<bool> capturing{false};
    using Feedback = typename Action::_action_feedback_type::_feedback_type;
    client_.sendGoal(goal, {}, {}, [&](const boost::shared_ptr<const Feedback>& feedback) {
      if (feedback->state == "capturing") capturing = true;
    });
    EXPECT_TRUE(test::WaitFor([&] { return capturing.load(); }, kTimeout_s));
    beside();
    Ended<ActionResult> ended;
    ended.state = test::WaitForEnd(client_, kTimeout_s);
    if (client_.getResult()) ended.result = *client_.getResult();
    return ended;
  }

  void MoveTo(const std::vector<double>& joint_positions) {
    MoveToViewGoal stop;
    stop.joint_positions = joint_positions;
    move_.sendGoal(stop);
    ASSERT_EQ(test::WaitForEnd(move_, kTimeout_s), "SUCCEEDED");
  }

  Transform Lookup(const std::string& target, const std::string& source) {
    const auto T = ros_io::LookupTransform(tf_, {target, source, ros::Time()}, kTimeout_s);
    EXPECT_TRUE(T) << T.error().message;
    return T ? *T : Transform::Identity();
  }

  [[nodiscard]] const std::string& edges_file() const { return edges_file_; }

 private:
  actionlib::SimpleActionClient<Action> client_;
  test::MoveClient move_;
  tf2_ros::Buffer tf_;
  tf2_ros::TransformListener listener_;
  tf2_ros::StaticTransformBroadcaster broadcaster_;
  std::string edges_file_;
};

/// Edge to the frame `true_camera`.
geometry_msgs::TransformStamped TrueCamera(const std::string& parent,
                                           const Eigen::Vector3d& translation_m,
                                           const Eigen::Vector4d& quaternion_xyzw) {
  const auto T = MakeTransform(translation_m, quaternion_xyzw.normalized());
  EXPECT_TRUE(T);
  geometry_msgs::TransformStamped edge;
  edge.header.stamp = ros::Time::now();
  edge.header.frame_id = parent;
  edge.child_frame_id = "true_camera";
  edge.transform = ros_io::ToTransformMessage(*T);
  return edge;
}

bool Says(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

Pose PoseOf(const geometry_msgs::PoseWithCovarianceStamped& message) {
  const auto pose = ros_io::FromMessage(message.pose, "none");
  EXPECT_TRUE(pose) << pose.error().message;
  return pose ? *pose : Pose();
}

/// Largest miss of a component over its standard deviation; those that have none do not count.
double WorstNormalized(const Pose& found, const Transform& truth) {
  const Vector6d error = Log(found.T_object_camera.inverse() * truth);
  double worst = 0.0;
  for (int k = 0; k < 6; ++k) {
    if (!(found.covariance(k, k) > 1e-18)) continue;
    worst = std::max(worst, std::abs(error[k]) / std::sqrt(found.covariance(k, k)));
  }
  return worst;
}

TEST(HandEye, IsFoundAndPutInForce) {
  DeviceCell<CalibrateHandEyeAction> cell(
      "calibrate_hand_eye", SOURCE_DIR "/config/cell_sim/arm_edges.yaml",
      TrueCamera("tool0", {0.006, -0.004, 0.012}, {0.0087262, -0.0130893, 0.0174524, 0.9997239}));
  EXPECT_TRUE(Says(cell.Run("accept").result.message, "solve first"));
  // From 55 deg above the horizon, rolled about the line of sight: axes must not be parallel.
  const std::vector<std::vector<double>> stops = {
      {-0.279995, 0.949791, -0.458203, -2.732, -1.548132, -0.912101},
      {-0.407585, 0.550848, 0.255272, -2.385622, -0.983562, 0.004723},
      {-0.249206, 0.193246, 0.795533, -1.776575, -0.371464, -0.953486},
      {0.249206, 0.193246, 0.795533, -1.365018, 0.371464, -0.01731},
      {0.407585, 0.550848, 0.255272, -0.755971, 0.983562, -2.17552},
      {0.279995, 0.949791, -0.458203, -0.409592, 1.548132, -0.058696},
      {-0.249206, 0.193246, 0.795533, -1.776575, -0.371464, 0.546514}};
  for (std::size_t k = 0; k < stops.size(); ++k) {
    cell.MoveTo(stops[k]);
    const auto added = cell.Run("add_pose");
    ASSERT_EQ(added.state, "SUCCEEDED") << added.result.message;
    ASSERT_EQ(added.result.poses.size(), k + 1);
    if (k == 1) {
      EXPECT_EQ(cell.Run("solve").state, "ABORTED") << "two poses are too few";
    }
  }
  const auto solved = cell.Run("solve");
  ASSERT_EQ(solved.state, "SUCCEEDED") << solved.result.message;
  EXPECT_TRUE(solved.result.acceptable) << solved.result.message;
  EXPECT_EQ(solved.result.camera.header.frame_id, "tool0");
  const Transform truth = cell.Lookup("tool0", "true_camera");
  const Pose found = PoseOf(solved.result.camera);
  EXPECT_LT(WorstNormalized(found, truth), 5.0);
  const Eigen::Vector3d lever(0.0, 0.0, 0.5);
  const double miss_m = (found.T_object_camera * lever - truth * lever).norm();
  RecordProperty("lever_um", static_cast<int>(1e6 * miss_m));
  EXPECT_LT(miss_m, 0.3e-3);
  const auto accepted = cell.Run("accept");
  ASSERT_EQ(accepted.state, "SUCCEEDED") << accepted.result.message;
  EXPECT_TRUE(test::WaitFor(
      [&] {
        const Transform now = cell.Lookup("tool0", "camera_optical_frame");
        return (now.matrix() - found.T_object_camera.matrix()).cwiseAbs().maxCoeff() < 1e-9;
      },
      kTimeout_s));
  const auto edges = ReadFrameEdges(cell.edges_file());
  ASSERT_TRUE(edges) << edges.error().message;
  EXPECT_EQ(edges->size(), 2U);
}

TEST(Turntable, AxisIsFoundAndPutInForce) {
  DeviceCell<CalibrateTurntableAction> cell(
      "calibrate_turntable", SOURCE_DIR "/config/cell_sim/turntable_edges.yaml",
      TrueCamera("turntable_base", {0.4350127, 0.003, 0.2835},
                 {-0.610052695577469, -0.6135529979291431, 0.3560307534845557, 0.353030494325978}));
  actionlib::SimpleActionClient<CalibrateHandEyeAction> other("calibrate_hand_eye", true);
  ASSERT_TRUE(test::WaitFor([&other] { return other.isServerConnected(); }, kTimeout_s));
  for (int k = 0; k < 6; ++k) {
    cell.MoveTo({-0.6 + 0.24 * k});
    const auto added = cell.Run("add_pose", "stop " + std::to_string(k));
    ASSERT_EQ(added.state, "SUCCEEDED") << added.result.message;
    if (k == 1) {
      EXPECT_EQ(cell.Run("solve").state, "ABORTED") << "two stops are too few";
    }
  }
  const auto meanwhile = cell.RunBeside("add_pose", [&other] {
    CalibrateHandEyeGoal goal;
    goal.step = "reset";
    other.sendGoal(goal);
    EXPECT_EQ(test::WaitForEnd(other, kTimeout_s), "ABORTED");
    EXPECT_TRUE(Says(other.getResult()->message, "another calibration is at work"));
  });
  ASSERT_EQ(meanwhile.state, "SUCCEEDED") << meanwhile.result.message;
  const auto solved = cell.Run("solve");
  ASSERT_EQ(solved.state, "SUCCEEDED") << solved.result.message;
  EXPECT_TRUE(solved.result.acceptable) << solved.result.message;
  const Transform truth = cell.Lookup("true_camera", "turntable_base");
  const Pose found = PoseOf(solved.result.turntable_base);
  // The axis alone: where its frame stands along and about it is a convention.
  const Eigen::Vector3d axis = truth.linear().col(2);
  const Eigen::Vector3d found_axis = found.T_object_camera.linear().col(2);
  const double angle_rad = std::acos(std::min(1.0, axis.dot(found_axis)));
  const Eigen::Vector3d between = found.T_object_camera.translation() - truth.translation();
  const double distance_m = (between - between.dot(axis) * axis).norm();
  RecordProperty("direction_mdeg", static_cast<int>(1e3 * angle_rad * 57.29577951));
  RecordProperty("distance_um", static_cast<int>(1e6 * distance_m));
  EXPECT_LT(angle_rad, 5.0 * solved.result.sigma_direction);
  EXPECT_LT(distance_m, 5.0 * solved.result.sigma_point);
  EXPECT_LT(angle_rad, 0.1 / 57.29577951);
  EXPECT_LT(distance_m, 0.3e-3);
  const auto accepted = cell.Run("accept");
  ASSERT_EQ(accepted.state, "SUCCEEDED") << accepted.result.message;
  EXPECT_TRUE(test::WaitFor(
      [&] {
        const Transform now = cell.Lookup("camera_optical_frame", "turntable_base");
        return now.linear().col(2).dot(found_axis) > 1.0 - 1e-12;
      },
      kTimeout_s))
      << "the edge is not in force";
}

}  // namespace
}  // namespace fringe_fusion

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "device_calibration_test");
  const ros::NodeHandle nh;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
