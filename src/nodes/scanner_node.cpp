#include "nodes/scanner_node.hpp"

#include <fringe_fusion/Capture.h>
#include <fringe_fusion/Frame.h>
#include <fringe_fusion/LoadSequence.h>
#include <fringe_fusion/ShowPattern.h>
#include <ros/console.h>

#include <utility>

#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/ros_io/configs.hpp"
#include "fringe_fusion/ros_io/frame_messages.hpp"
#include "fringe_fusion/ros_io/pattern_messages.hpp"
#include "fringe_fusion/ros_io/service_call.hpp"
#include "fringe_fusion/ros_io/tf_lookup.hpp"
#include "nodes/calibrated_frames.hpp"

namespace fringe_fusion::nodes {

Result<std::unique_ptr<ScannerNode>> ScannerNode::Create(ros::NodeHandle nh,
                                                         ros::NodeHandle private_nh) {
  Result<Setup> setup = LoadSetup(private_nh);
  if (!setup) return Forward(setup);
  return std::unique_ptr<ScannerNode>(new ScannerNode(std::move(nh), std::move(*setup)));
}

Result<ScannerNode::Setup> ScannerNode::LoadSetup(const ros::NodeHandle& private_nh) {
  Setup setup;
  const auto config = ros_io::LoadConfig<ScannerNodeConfig>(private_nh);
  if (!config) return Forward(config);
  setup.config = *config;
  const auto prior =
      ros_io::LoadConfig<ros_io::PosePriorConfig>(ros::NodeHandle(private_nh, "prior"));
  if (!prior) return Forward(prior);
  setup.prior = *prior;
  const auto motion = ros_io::LoadConfig<MotionWatchConfig>(ros::NodeHandle(private_nh, "motion"));
  if (!motion) return Forward(motion);
  setup.motion = *motion;
  const auto pattern = ros_io::LoadConfig<PatternConfig>(ros::NodeHandle(private_nh, "pattern"));
  if (!pattern) return Forward(pattern);
  const Result<CellCalibration> calibration = ReadCellCalibration(config->calibration_file);
  if (!calibration) return Forward(calibration);
  setup.calibration = *calibration;
  const Result<PatternSequence> sequence =
      MakeSequence(*pattern, calibration->projector.width, calibration->projector.height);
  if (!sequence) return Forward(sequence);
  setup.sequence = *sequence;
  auto edges = LoadEdges(ros::NodeHandle(private_nh, "edges"));
  if (!edges) return Forward(edges);
  setup.edges = std::move(*edges);
  const auto scanner_edges =
      ScannerEdges(setup.calibration, setup.config.camera_frame, setup.config.projector_frame);
  setup.edges.insert(setup.edges.end(), scanner_edges.begin(), scanner_edges.end());
  return setup;
}

ScannerNode::ScannerNode(ros::NodeHandle nh, Setup setup)
    : setup_(std::move(setup)),
      nh_(std::move(nh)),
      tf_buffer_(ros::Duration(setup_.config.tf_cache_s)),
      tf_listener_(tf_buffer_, nh_),
      motion_(nh_, setup_.motion),
      server_(
          nh_, "scan_view", [this](const ScanViewGoalConstPtr& goal) { Execute(*goal); },
          /*auto_start=*/false) {
  frame_publisher_ =
      nh_.advertise<Frame>("frames", static_cast<std::uint32_t>(2 * setup_.sequence.frames.size()));
  static_broadcaster_.sendTransform(setup_.edges);
  server_.start();
}

ScannerNode::~ScannerNode() {
  stopping_ = true;
  server_.shutdown();
}

void ScannerNode::Execute(const ScanViewGoal& goal) {
  ScanViewResult result;
  const auto abort = [&](const std::string& message) {
    result.success = 0;
    result.message = message;
    if (Cancelled()) {
      ROS_INFO("view %u of scan '%s' cancelled", goal.view_id, goal.scan_id.c_str());
      server_.setPreempted(result, message);
    } else {
      ROS_ERROR("view %u of scan '%s' failed: %s", goal.view_id, goal.scan_id.c_str(),
                message.c_str());
      server_.setAborted(result, message);
    }
  };
  Feedback(0, "waiting for the motion to settle");
  const Result<std::vector<double>> joints = motion_.WaitSettled();
  if (!joints) return abort(joints.error().message);
  const Result<ImageStack> stack = CaptureView(goal);
  if (!stack) return abort(stack.error().message);
  Feedback(stack->frames.size(), "writing the frames");
  if (!goal.scan_folder.empty()) {
    const Status written = WriteView(*stack, goal.scan_folder, *joints);
    if (!written) return abort(written.error().message);
  }
  result.success = 1;
  result.num_frames = static_cast<std::uint32_t>(stack->frames.size());
  result.first_stamp = ros_io::ToRosTime(stack->frames.front().stamp_ns);
  result.last_stamp = ros_io::ToRosTime(stack->frames.back().stamp_ns);
  server_.setSucceeded(result);
}

Result<ImageStack> ScannerNode::CaptureView(const ScanViewGoal& goal) {
  if (Status status = LoadSequence(); !status) return tl::unexpected<Error>(status.error());
  ImageStack stack;
  stack.scan_id = goal.scan_id;
  stack.view_id = static_cast<int>(goal.view_id);
  stack.camera_id = setup_.calibration.camera_serial;
  stack.sequence = setup_.sequence;
  std::int64_t previous_ns = 0;
  for (std::size_t i = 0; i < stack.sequence.frames.size(); ++i) {
    if (Cancelled()) return Fail("{}", kCancelled);
    Result<CapturedFrame> frame = CaptureFrame(goal, i, previous_ns);
    if (!frame) return Forward(frame);
    previous_ns = frame->stamp_ns;
    stack.frames.push_back(std::move(*frame));
    frame_publisher_.publish(ros_io::ToMessage(stack, i, setup_.config.camera_frame));
    Feedback(i + 1, "capturing");
  }
  if (Status status = Validate(stack, fmt::format("view {}", goal.view_id)); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return stack;
}

Status ScannerNode::LoadSequence() {
  fringe_fusion::LoadSequence::Request request;
  request.sequence = ros_io::ToMessage(setup_.sequence);
  const auto loaded = ros_io::CallService<fringe_fusion::LoadSequence>(
      nh_, setup_.config.projector_node + "/load_sequence", request,
      setup_.config.service_timeout_s);
  if (!loaded) return tl::unexpected<Error>(loaded.error());
  return {};
}

Result<CapturedFrame> ScannerNode::CaptureFrame(const ScanViewGoal& goal, std::size_t index,
                                                std::int64_t previous_ns) {
  Result<CapturedFrame> frame = TryFrame(goal, index, previous_ns);
  for (int retry = 1; !frame && retry <= setup_.config.max_retries && !Cancelled(); ++retry) {
    ROS_WARN_THROTTLE(5.0, "frame %zu, attempt %d of %d: %s", index, retry,
                      setup_.config.max_retries + 1, frame.error().message.c_str());
    frame = TryFrame(goal, index, previous_ns);
  }
  if (Cancelled()) return Fail("{}", kCancelled);
  if (!frame) {
    return Fail("frame {} of {} failed {} times: {}", index, setup_.sequence.frames.size(),
                setup_.config.max_retries + 1, frame.error().message);
  }
  return frame;
}

Result<CapturedFrame> ScannerNode::TryFrame(const ScanViewGoal& goal, std::size_t index,
                                            std::int64_t previous_ns) {
  ShowPattern::Request show;
  show.index = static_cast<std::uint32_t>(index);
  const auto shown = ros_io::CallService<ShowPattern>(
      nh_, setup_.config.projector_node + "/show_pattern", show, setup_.config.show_timeout_s);
  if (!shown) return Forward(shown);
  const std::int64_t shown_ns = ros_io::FromRosTime(ros::Time::now());
  Capture::Request capture;
  capture.exposure = setup_.config.exposure_s * setup_.sequence.frames[index].exposure_ratio;
  capture.gain = setup_.config.gain;
  capture.timeout = ros::Duration(setup_.config.capture_timeout_s);
  capture.view_id = goal.view_id;
  capture.frame_index = static_cast<std::uint32_t>(index);
  const auto captured = ros_io::CallService<Capture>(
      nh_, setup_.config.camera_node + "/capture", capture,
      setup_.config.capture_timeout_s + setup_.config.service_timeout_s);
  if (!captured) return Forward(captured);
  ros_io::ExposureInfo exposure;
  exposure.bit_depth = captured->bit_depth <= 16 ? static_cast<int>(captured->bit_depth) : 0;
  exposure.exposure_s = captured->exposure;
  exposure.gain = captured->gain;
  Result<CapturedFrame> frame = ros_io::FromMessage(captured->image, exposure);
  if (!frame) return frame;
  if (Status status = CheckFrame(*frame, shown_ns, previous_ns); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return frame;
}

Status ScannerNode::CheckFrame(const CapturedFrame& frame, std::int64_t earliest_ns,
                               std::int64_t previous_ns) const {
  const CameraModel& camera = setup_.calibration.camera;
  if (Width(frame) != camera.width || Height(frame) != camera.height) {
    return Fail("the camera's image of {} x {} px must be {} x {} px as calibrated", Width(frame),
                Height(frame), camera.width, camera.height);
  }
  if (frame.stamp_ns <= previous_ns) {
    return Fail("the frame's stamp is not later than that of the frame before: a repeated frame");
  }
  const double early_s = 1e-9 * static_cast<double>(earliest_ns - frame.stamp_ns);
  if (early_s > setup_.config.stamp_tolerance_s) {
    return Fail("the frame was exposed {:.6f} s before its pattern was shown (limit {:.6f} s)",
                early_s, setup_.config.stamp_tolerance_s);
  }
  return {};
}

Status ScannerNode::WriteView(const ImageStack& stack, const std::string& folder,
                              const std::vector<double>& joint_positions) {
  const Result<ScanFolder> scan = CreateScan(folder, setup_.calibration, setup_.sequence);
  if (!scan) return tl::unexpected<Error>(scan.error());
  const Result<Transform> T_object_camera =
      ros_io::LookupTransform(tf_buffer_,
                              {setup_.config.object_frame, setup_.config.camera_frame,
                               ros_io::ToRosTime(stack.frames.front().stamp_ns)},
                              setup_.config.tf_timeout_s);
  if (!T_object_camera) return tl::unexpected<Error>(T_object_camera.error());
  return WriteStack(*scan, stack,
                    ros_io::PriorPose(*T_object_camera, setup_.prior, PoseSource::kTf),
                    joint_positions);
}

void ScannerNode::Feedback(std::size_t frame, const char* state) {
  ScanViewFeedback feedback;
  feedback.frame = static_cast<std::uint32_t>(frame);
  feedback.num_frames = static_cast<std::uint32_t>(setup_.sequence.frames.size());
  feedback.state = state;
  server_.publishFeedback(feedback);
}

bool ScannerNode::Cancelled() { return stopping_ || server_.isPreemptRequested() || !ros::ok(); }

}  // namespace fringe_fusion::nodes
