#include "nodes/motion_node.hpp"

#include <sensor_msgs/JointState.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "fringe_fusion/ros_io/configs.hpp"
#include "nodes/backends/replay_motion.hpp"
#include "nodes/backends/sim_motion.hpp"

namespace fringe_fusion::nodes {
namespace {

struct Axes {
  std::vector<std::string> names;
  std::vector<double> positions;
};

Result<Axes> LoadAxes(const ros::NodeHandle& nh) {
  const auto names = ros_io::RequiredParameter<std::vector<std::string>>(nh, "joint_names");
  if (!names) return Forward(names);
  const auto positions = ros_io::RequiredParameter<std::vector<double>>(nh, "initial_positions");
  if (!positions) return Forward(positions);
  if (names->empty()) return Fail("parameter {} is empty", nh.resolveName("joint_names"));
  if (names->size() != positions->size()) {
    return Fail("parameter {} has {} values, must have one per joint, {}",
                nh.resolveName("initial_positions"), positions->size(), names->size());
  }
  const auto is_finite = [](double position) { return std::isfinite(position); };
  if (!std::all_of(positions->begin(), positions->end(), is_finite)) {
    return Fail("parameter {} has a value that is not finite", nh.resolveName("initial_positions"));
  }
  return Axes{*names, *positions};
}

Result<std::unique_ptr<Motion>> MakeMotion(const std::string& backend, const Axes& axes,
                                           const ros::NodeHandle& private_nh) {
  ros_io::DeclareConfig<SimMotionConfig>(ros::NodeHandle(private_nh, "sim"));
  ros_io::DeclareConfig<ReplayMotionConfig>(ros::NodeHandle(private_nh, "replay"));
  const ros::NodeHandle backend_nh(private_nh, backend);
  if (backend == "sim") {
    const auto config = ros_io::LoadConfig<SimMotionConfig>(backend_nh);
    if (!config) return Forward(config);
    return std::make_unique<SimMotion>(*config, axes.positions,
                                       [] { return ros::SteadyTime::now().toSec(); });
  }
  if (backend == "replay") {
    const auto config = ros_io::LoadConfig<ReplayMotionConfig>(backend_nh);
    if (!config) return Forward(config);
    return std::make_unique<ReplayMotion>(*config, axes.positions);
  }
  return Fail("parameter {} is '{}', must be sim or replay", private_nh.resolveName("backend"),
              backend);
}

}  // namespace

Result<std::unique_ptr<MotionNode>> MotionNode::Create(const ros::NodeHandle& nh,
                                                       const ros::NodeHandle& private_nh) {
  const auto config = ros_io::LoadConfig<MotionNodeConfig>(private_nh);
  if (!config) return Forward(config);
  const Result<Axes> axes = LoadAxes(private_nh);
  if (!axes) return Forward(axes);
  auto motion = MakeMotion(config->backend, *axes, private_nh);
  if (!motion) return Forward(motion);
  return std::unique_ptr<MotionNode>(
      new MotionNode(nh, private_nh, *config, axes->names, std::move(*motion)));
}

MotionNode::MotionNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                       MotionNodeConfig config, std::vector<std::string> joint_names,
                       std::unique_ptr<Motion> motion)
    : config_(std::move(config)),
      joint_names_(std::move(joint_names)),
      motion_(std::move(motion)),
      diagnostics_(nh, private_nh, ros::this_node::getName()) {
  ros::NodeHandle handle = nh;
  joint_states_ = handle.advertise<sensor_msgs::JointState>("joint_states", 10);
  joint_states_timer_ = handle.createTimer(ros::Duration(1.0 / config_.rate_hz),
                                           [this](const auto&) { PublishJointStates(); });
  diagnostics_.setHardwareID(motion_->Id());
  diagnostics_.add("axes", this, &MotionNode::Diagnose);
  diagnostics_timer_ =
      handle.createTimer(ros::Duration(0.5), [this](const auto&) { diagnostics_.update(); });
  server_ = std::make_unique<Server>(
      handle, "move_to_view", [this](const auto& goal) { Execute(goal); }, /*auto_start=*/false);
  server_->start();
  ROS_INFO("%s drives %zu joints", motion_->Id().c_str(), joint_names_.size());
}

MotionNode::~MotionNode() {
  ending_ = true;
  server_.reset();  // Waits for Execute.
  if (const Status stopped = motion_->Stop(); !stopped) {
    ROS_ERROR("axes were not stopped: %s", stopped.error().message.c_str());
  }
}

void MotionNode::Execute(const MoveToViewGoalConstPtr& goal) {
  if (Status started = motion_->MoveTo(goal->joint_positions); !started) {
    MoveToViewResult result;
    result.message = started.error().message;
    ROS_ERROR("move_to_view refused: %s", result.message.c_str());
    server_->setAborted(result, result.message);
    return;
  }
  const ros::SteadyTime deadline = ros::SteadyTime::now() + ros::WallDuration(config_.timeout_s);
  while (ros::ok()) {
    const Result<Motion::State> state = motion_->Poll();
    if (!state) return StopAndEnd(false, state.error().message);
    if (server_->isPreemptRequested()) return StopAndEnd(true, "motion cancelled");
    if (ending_) return StopAndEnd(false, "motion_node ends");
    if (state->settled) {
      MoveToViewResult result;
      result.success = 1;
      result.joint_positions = state->joint_positions;
      server_->setSucceeded(result);
      return;
    }
    if (ros::SteadyTime::now() > deadline) {
      return StopAndEnd(false, fmt::format("{}: not settled within {} s: is an axis blocked?",
                                           motion_->Id(), config_.timeout_s));
    }
    MoveToViewFeedback feedback;
    feedback.joint_positions = state->joint_positions;
    server_->publishFeedback(feedback);
    ros::WallDuration(0.01).sleep();
  }
}

void MotionNode::StopAndEnd(bool preempted, const std::string& message) {
  MoveToViewResult result;
  result.message = message;
  const ros::SteadyTime deadline = ros::SteadyTime::now() + ros::WallDuration(config_.timeout_s);
  bool rests = false;
  if (Status stopped = motion_->Stop(); !stopped) result.message += "; " + stopped.error().message;
  while (!rests && ros::ok() && ros::SteadyTime::now() < deadline) {
    const Result<Motion::State> state = motion_->Poll();
    if (!state) break;
    rests = state->settled;
    result.joint_positions = state->joint_positions;
    ros::WallDuration(0.005).sleep();
  }
  if (!rests) result.message += "; the axes do not rest yet";
  ROS_WARN("move_to_view ended: %s", result.message.c_str());
  if (preempted) {
    server_->setPreempted(result, result.message);
  } else {
    server_->setAborted(result, result.message);
  }
}

void MotionNode::PublishJointStates() {
  const Result<Motion::State> state = motion_->Poll();
  if (!state) {
    ROS_ERROR_THROTTLE(5.0, "no joint_states: %s", state.error().message.c_str());
    return;
  }
  sensor_msgs::JointState message;
  message.header.stamp = ros::Time::now();
  message.name = joint_names_;
  message.position = state->joint_positions;
  message.velocity = state->joint_velocities;
  joint_states_.publish(message);
}

void MotionNode::Diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const Result<Motion::State> state = motion_->Poll();
  if (!state) {
    status.summary(diagnostic_msgs::DiagnosticStatus::ERROR, state.error().message);
    return;
  }
  status.summary(diagnostic_msgs::DiagnosticStatus::OK, state->settled ? "settled" : "moving");
  for (std::size_t i = 0; i < joint_names_.size(); ++i) {
    status.add(joint_names_[i] + " [rad]", state->joint_positions[i]);
  }
}

}  // namespace fringe_fusion::nodes
