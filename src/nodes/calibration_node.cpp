#include "nodes/calibration_node.hpp"

#include <ros/console.h>

#include <algorithm>
#include <utility>

#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/ros_io/configs.hpp"

namespace fringe_fusion::nodes {
Result<std::unique_ptr<CalibrationNode>> CalibrationNode::Create(ros::NodeHandle nh,
                                                                 ros::NodeHandle private_nh) {
  Result<Setup> setup = LoadSetup(private_nh);
  if (!setup) return Forward(setup);
  return std::unique_ptr<CalibrationNode>(new CalibrationNode(nh, std::move(*setup)));
}

Result<CalibrationNode::Setup> CalibrationNode::LoadSetup(const ros::NodeHandle& private_nh) {
  Setup setup;
  const auto config = ros_io::LoadConfig<CalibrationNodeConfig>(private_nh);
  if (!config) return Forward(config);
  setup.config = *config;
  const auto nodes =
      ros_io::RequiredParameter<std::vector<std::string>>(private_nh, "reload_nodes");
  if (!nodes) return Forward(nodes);
  setup.reload_nodes = *nodes;
  const auto phase = ros_io::LoadConfig<PhaseConfig>(ros::NodeHandle(private_nh, "phase"));
  if (!phase) return Forward(phase);
  const auto detect = ros_io::LoadConfig<DetectConfig>(ros::NodeHandle(private_nh, "detect"));
  if (!detect) return Forward(detect);
  const auto transfer = ros_io::LoadConfig<TransferConfig>(ros::NodeHandle(private_nh, "transfer"));
  if (!transfer) return Forward(transfer);
  setup.sighting = {*phase, *detect, *transfer};
  const auto calibration =
      ros_io::LoadConfig<CalibrationConfig>(ros::NodeHandle(private_nh, "calibration"));
  if (!calibration) return Forward(calibration);
  setup.calibration = *calibration;
  auto target = LoadTarget(config->target_file);
  if (!target) return Forward(target);
  setup.target = std::move(*target);
  auto in_force = ReadCellCalibration(config->calibration_file);
  if (!in_force) return Forward(in_force);
  setup.in_force = std::move(*in_force);
  if (Status status = LoadDevices(private_nh, setup); !status) return Forward(status);
  return setup;
}

Status CalibrationNode::LoadDevices(const ros::NodeHandle& private_nh, Setup& setup) {
  const auto hand_eye = ros_io::LoadConfig<HandEyeConfig>(ros::NodeHandle(private_nh, "hand_eye"));
  if (!hand_eye) return Forward(hand_eye);
  setup.hand_eye = *hand_eye;
  const ros::NodeHandle hand_eye_nh(private_nh, "hand_eye_frames");
  const auto hand_eye_frames = ros_io::LoadConfig<HandEyeSetup>(hand_eye_nh);
  if (!hand_eye_frames) return Forward(hand_eye_frames);
  setup.hand_eye_frames = *hand_eye_frames;
  const auto mount = HandEyeMountFromName(hand_eye_frames->mount);
  if (!mount) return Fail("{}: {}", hand_eye_nh.getNamespace(), mount.error().message);
  setup.mount = *mount;
  const auto turntable =
      ros_io::LoadConfig<TurntableConfig>(ros::NodeHandle(private_nh, "turntable"));
  if (!turntable) return Forward(turntable);
  setup.turntable = *turntable;
  const auto turntable_frames =
      ros_io::LoadConfig<TurntableSetup>(ros::NodeHandle(private_nh, "turntable_frames"));
  if (!turntable_frames) return Forward(turntable_frames);
  setup.turntable_frames = *turntable_frames;
  return {};
}

CalibrationNode::CalibrationNode(const ros::NodeHandle& nh, Setup setup)
    : setup_(std::move(setup)),
      nh_(nh),
      capture_(nh_, {{setup_.config.server_timeout_s, setup_.config.scan_timeout_s},
                     setup_.config.frames_timeout_s}),
      files_(nh_, setup_.reload_nodes, setup_.config.reload_timeout_s),
      tf_listener_(tf_buffer_, nh_),
      cell_task_(nh_,
                 {setup_.config.calibration_file, setup_.config.camera_info_folder,
                  setup_.config.camera_frame, setup_.config.marker_enlarge, setup_.target,
                  setup_.calibration, setup_.in_force},
                 files_),
      hand_eye_task_(nh_, Devices(), tf_buffer_, files_,
                     HandEyeTask::Setup{setup_.hand_eye_frames, setup_.mount, setup_.hand_eye}),
      turntable_task_(nh_, Devices(), tf_buffer_, files_, setup_.turntable_frames,
                      setup_.turntable),
      cell_server_(
          nh_, "calibrate_cell",
          [this](const CalibrateCellGoalConstPtr& goal) {
            Execute(cell_server_, cell_task_,
                    {goal->step, goal->pose, goal->force != 0, goal->report_folder});
          },
          /*auto_start=*/false),
      hand_eye_server_(
          nh_, "calibrate_hand_eye",
          [this](const CalibrateHandEyeGoalConstPtr& goal) {
            Execute(hand_eye_server_, hand_eye_task_,
                    {goal->step, goal->pose, goal->force != 0, ""});
          },
          /*auto_start=*/false),
      turntable_server_(
          nh_, "calibrate_turntable",
          [this](const CalibrateTurntableGoalConstPtr& goal) {
            Execute(turntable_server_, turntable_task_,
                    {goal->step, goal->pose, goal->force != 0, ""});
          },
          /*auto_start=*/false) {
  cell_server_.start();
  hand_eye_server_.start();
  turntable_server_.start();
  ROS_INFO("ready to calibrate with a target '%s' of %d x %d points",
           TargetKindName(setup_.target.kind), setup_.target.num_columns, setup_.target.num_rows);
}

CalibrationNode::~CalibrationNode() {
  stopping_ = true;
  cell_server_.shutdown();
  hand_eye_server_.shutdown();
  turntable_server_.shutdown();
}

DeviceContext CalibrationNode::Devices() const {
  return {setup_.config.camera_frame,
          setup_.config.edges_file,
          setup_.config.scanner_node,
          setup_.config.tf_timeout_s,
          setup_.target,
          [this] { return cell_task_.in_force(); }};
}

template <typename Action, typename Task>
void CalibrationNode::Execute(Server<Action>& server, Task& task, const Step& step) {
  Watch watch;
  watch.cancelled = [this, &server] {
    return stopping_ || server.isPreemptRequested() || !ros::ok();
  };
  watch.feedback = [&server](const std::string& state, std::uint32_t frame,
                             std::uint32_t num_frames) {
    typename Action::_action_feedback_type::_feedback_type feedback;
    feedback.state = state;
    feedback.frame = frame;
    feedback.num_frames = num_frames;
    server.publishFeedback(feedback);
  };
  typename Action::_action_result_type::_result_type result;
  Result<std::string> outcome = Fail("another calibration is at work: wait, or cancel it first");
  {
    const std::unique_lock<std::mutex> lock(step_mutex_, std::try_to_lock);
    if (lock.owns_lock()) {
      outcome = Run(task, step, watch);
      result = task.Message();
    }
  }
  result.success = static_cast<std::uint8_t>(outcome.has_value());
  result.message = outcome ? *outcome : outcome.error().message;
  if (outcome) {
    ROS_INFO("%s: %s", step.step.c_str(), result.message.c_str());
    server.setSucceeded(result);
  } else if (watch.cancelled()) {
    ROS_INFO("%s was cancelled", step.step.c_str());
    server.setPreempted(result, result.message);
  } else {
    ROS_ERROR("%s failed: %s", step.step.c_str(), result.message.c_str());
    server.setAborted(result, result.message);
  }
}

Result<std::string> CalibrationNode::Run(CalibrationTask& task, const Step& step,
                                         const Watch& watch) {
  if (step.step == "add_pose") return AddPose(task, step.pose, watch);
  if (step.step == "remove_pose") return task.Remove(step.pose);
  if (step.step == "reset") {
    task.Reset();
    return "all poses are forgotten";
  }
  if (step.step == "solve") {
    watch.feedback("solving", 0, 0);
    return task.Solve(step.report_folder);
  }
  if (step.step == "accept") {
    watch.feedback("putting the calibration in force", 0, 0);
    return task.Accept(step.force);
  }
  return Fail("step '{}' must be add_pose, remove_pose, solve, accept or reset", step.step);
}

Result<std::string> CalibrationNode::AddPose(CalibrationTask& task, const std::string& name,
                                             const Watch& watch) {
  const std::vector<std::string> names = task.Names();
  if (names.size() >= static_cast<std::size_t>(setup_.config.max_poses)) {
    return Fail("there are {} poses, at most {} are kept: remove some", names.size(),
                setup_.config.max_poses);
  }
  // Before the work.
  const auto taken = [&names](const std::string& candidate) {
    return std::find(names.begin(), names.end(), candidate) != names.end();
  };
  if (taken(name)) return Fail("there is a pose '{}' already", name);
  std::string made = name;
  while (made.empty() || (name.empty() && taken(made))) {
    made = fmt::format("pose_{:02d}", num_named_++);
  }
  watch.feedback("waiting for the scanner", 0, 0);
  const auto on_frame = [&watch](std::uint32_t frame, std::uint32_t num_frames) {
    watch.feedback("capturing", frame, num_frames);
  };
  const auto stack = capture_.Capture(on_frame, watch.cancelled);
  if (!stack) return Forward(stack);
  watch.feedback("looking for the target", 0, 0);
  auto sighting = SightTarget(*stack, setup_.target, setup_.sighting, made);
  if (!sighting) return Forward(sighting);
  // A cancelled pose leaves no trace.
  if (watch.cancelled()) return Fail("{}", kCancelled);
  watch.feedback("solving", 0, 0);
  return task.Add({std::move(*sighting), stack->frames.front().stamp_ns});
}

}  // namespace fringe_fusion::nodes
