#pragma once

#include <actionlib/server/simple_action_server.h>
#include <diagnostic_updater/diagnostic_updater.h>
#include <fringe_fusion/MoveToViewAction.h>
#include <ros/node_handle.h>

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "fringe_fusion/capture/devices.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::nodes {

struct MotionNodeConfig {
  std::string backend = "sim";  ///< sim
  double rate_hz = 50.0;        ///< of joint_states
  double timeout_s = 30.0;      ///< of one motion

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("backend", backend);
    field("rate_hz", rate_hz, 1.0, 1000.0);
    field("timeout_s", timeout_s, 0.1, 3600.0);
  }
};

/// Moves a turntable or an arm: action `move_to_view`, topic `joint_states`. A cancelled goal, a
/// motion that takes too long and the end of the node stop the axes.
class MotionNode {
 public:
  /// @return error naming a parameter.
  [[nodiscard]] static Result<std::unique_ptr<MotionNode>> Create(
      const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  ~MotionNode();

 private:
  using Server = actionlib::SimpleActionServer<MoveToViewAction>;

  MotionNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh, MotionNodeConfig config,
             std::vector<std::string> joint_names, std::unique_ptr<Motion> motion);

  void Execute(const MoveToViewGoalConstPtr& goal);
  /// Stops, waits until the axes rest, and ends the goal as preempted or aborted.
  void StopAndEnd(bool preempted, const std::string& message);
  void PublishJointStates();
  void Diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  MotionNodeConfig config_;
  std::vector<std::string> joint_names_;
  std::unique_ptr<Motion> motion_;
  std::atomic<bool> ending_{false};

  ros::Publisher joint_states_;
  diagnostic_updater::Updater diagnostics_;
  ros::Timer joint_states_timer_;
  ros::Timer diagnostics_timer_;
  std::unique_ptr<Server> server_;
};

}  // namespace fringe_fusion::nodes
