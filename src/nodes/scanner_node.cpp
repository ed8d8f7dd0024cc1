#include "nodes/scanner_node.hpp"

#include <fringe_fusion/Frame.h>
#include <ros/console.h>

#include <algorithm>
#include <utility>

#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/ros_io/configs.hpp"
#include "fringe_fusion/ros_io/frame_messages.hpp"
#include "fringe_fusion/ros_io/suggestion_messages.hpp"
#include "fringe_fusion/ros_io/tf_lookup.hpp"
#include "nodes/calibrated_frames.hpp"
#include "nodes/calibration_reload.hpp"

namespace fringe_fusion::nodes {
namespace {
constexpr std::uint32_t kMaxBudgetFrames = 100000;
}  // namespace

Result<std::unique_ptr<ScannerNode>> ScannerNode::Create(ros::NodeHandle nh,
                                                         ros::NodeHandle private_nh) {
  Result<Setup> setup = LoadSetup(private_nh);
  if (!setup) return Forward(setup);
  return std::unique_ptr<ScannerNode>(
      new ScannerNode(std::move(nh), private_nh, std::move(*setup)));
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
  const auto phase = ros_io::LoadConfig<PhaseConfig>(ros::NodeHandle(private_nh, "phase"));
  if (!phase) return Forward(phase);
  setup.phase = *phase;
  const auto diagnosis =
      ros_io::LoadConfig<DiagnosisConfig>(ros::NodeHandle(private_nh, "diagnosis"));
  if (!diagnosis) return Forward(diagnosis);
  setup.diagnosis = *diagnosis;
  const auto assistant =
      ros_io::LoadConfig<CaptureAssistantConfig>(ros::NodeHandle(private_nh, "capture_assistant"));
  if (!assistant) return Forward(assistant);
  setup.assistant = *assistant;
  const auto pattern = ros_io::LoadConfig<PatternConfig>(ros::NodeHandle(private_nh, "pattern"));
  if (!pattern) return Forward(pattern);
  const Result<CellCalibration> calibration = ReadCellCalibration(config->calibration_file);
  if (!calibration) return Forward(calibration);
  setup.calibration = *calibration;
  const Result<PatternSequence> sequence =
      MakeSequence(*pattern, calibration->projector.width, calibration->projector.height);
  if (!sequence) return Forward(sequence);
  setup.sequence = *sequence;
  auto edges = LoadAllEdges(private_nh, setup.config, setup.calibration);
  if (!edges) return Forward(edges);
  setup.edges = std::move(*edges);
  return setup;
}

Result<std::vector<geometry_msgs::TransformStamped>> ScannerNode::LoadAllEdges(
    const ros::NodeHandle& private_nh, const ScannerNodeConfig& config,
    const CellCalibration& calibration) {
  auto edges = LoadEdges(ros::NodeHandle(private_nh, "edges"));
  if (!edges) return edges;
  const auto of_scanner = ScannerEdges(calibration, config.camera_frame, config.projector_frame);
  edges->insert(edges->end(), of_scanner.begin(), of_scanner.end());
  return edges;
}

ScannerNode::ScannerNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh, Setup setup)
    : setup_(std::move(setup)),
      nh_(std::move(nh)),
      private_nh_(private_nh),
      tf_buffer_(ros::Duration(setup_.config.tf_cache_s)),
      tf_listener_(tf_buffer_, nh_),
      motion_(nh_, setup_.motion),
      capture_(nh_, setup_.config, setup_.calibration),
      watch_(nh_, private_nh, {setup_.phase, setup_.diagnosis}),
      server_(
          nh_, "scan_view", [this](const ScanViewGoalConstPtr& goal) { Execute(*goal); },
          /*auto_start=*/false) {
  const auto queue_size = static_cast<std::uint32_t>(2 * setup_.sequence.frames.size());
  frame_publisher_ = nh_.advertise<Frame>("frames", queue_size);
  calibration_frame_publisher_ = nh_.advertise<Frame>("calibration_frames", queue_size);
  static_broadcaster_.sendTransform(setup_.edges);
  ros::NodeHandle private_handle = private_nh;
  suggest_ =
      private_handle.advertiseService("suggest_settings", &ScannerNode::OnSuggestSettings, this);
  reload_ = AdvertiseReload(private_nh, [this] { return ReloadCalibration(); });
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
  const std::unique_lock<std::mutex> devices(devices_mutex_, std::try_to_lock);
  if (!devices.owns_lock()) return abort("the scanner is busy with test exposures");
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
  Feedback(stack->frames.size(), "examining the frames");
  // What is being calibrated may be a guess, and tells nothing of the frames.
  std::optional<CellCalibration> calibration;
  if (goal.calibration == 0) calibration = setup_.calibration;
  result.findings = watch_.Examine(*stack, calibration);
  result.success = 1;
  result.num_frames = static_cast<std::uint32_t>(stack->frames.size());
  result.first_stamp = ros_io::ToRosTime(stack->frames.front().stamp_ns);
  result.last_stamp = ros_io::ToRosTime(stack->frames.back().stamp_ns);
  server_.setSucceeded(result);
}

Result<ImageStack> ScannerNode::CaptureView(const ScanViewGoal& goal) {
  const ros::Publisher& publisher =
      goal.calibration != 0 ? calibration_frame_publisher_ : frame_publisher_;
  const PatternCapture::Request request{goal.scan_id, static_cast<int>(goal.view_id),
                                        setup_.sequence};
  return capture_.CaptureSequence(
      request,
      [&](const ImageStack& stack) {
        const std::size_t count = stack.frames.size();
        publisher.publish(ros_io::ToMessage(stack, count - 1, setup_.config.camera_frame));
        Feedback(count, "capturing");
      },
      [this] { return Cancelled(); });
}

bool ScannerNode::OnSuggestSettings(SuggestSettings::Request& request,
                                    SuggestSettings::Response& response) {
  const Result<CaptureProposal> proposal = Suggest(request);
  if (!proposal) {
    response.success = 0;
    response.message = proposal.error().message;
    ROS_ERROR("no settings suggested: %s", response.message.c_str());
    return true;
  }
  response = ros_io::ToMessage(*proposal);
  ROS_INFO("suggested: %s", response.message.c_str());
  return true;
}

Result<CaptureProposal> ScannerNode::Suggest(const SuggestSettings::Request& request) {
  const std::unique_lock<std::mutex> devices(devices_mutex_, std::try_to_lock);
  if (!devices.owns_lock()) return Fail("the scanner is busy with a view");
  CaptureBudget budget;
  budget.frames = static_cast<int>(std::min(request.frames, kMaxBudgetFrames));
  budget.seconds = request.seconds;
  CaptureAssistantConfig assistant = setup_.assistant;
  if (request.max_exposure != 0.0) assistant.max_exposure_s = request.max_exposure;
  Status status = Validate(budget);
  if (status) status = CheckBounds(assistant, "max_exposure");
  if (!status) return tl::unexpected<Error>(status.error());
  const CameraModel& projector = setup_.calibration.projector;
  const auto sequence =
      MakeSequence(TestPattern(setup_.calibration), projector.width, projector.height);
  if (!sequence) return Forward(sequence);
  const Result<std::vector<double>> joints = motion_.WaitSettled();
  if (!joints) return Forward(joints);
  // The frames are for this question alone: they are not published.
  const auto test = capture_.CaptureSequence(
      {"test_exposures", 0, *sequence}, [](const ImageStack& /*stack*/) {},
      [this] { return stopping_ || !ros::ok(); });
  if (!test) return Forward(test);
  const auto scene = MeasureCaptureScene(*test, setup_.calibration, setup_.phase, assistant);
  if (!scene) return Forward(scene);
  return ProposeCapture(*scene, setup_.phase, assistant, budget);
}

Status ScannerNode::ReloadCalibration() {
  const std::unique_lock<std::mutex> devices(devices_mutex_, std::try_to_lock);
  if (!devices.owns_lock()) return Fail("the scanner is busy with a view");
  auto calibration = RereadCalibration(setup_.config.calibration_file, setup_.calibration);
  if (!calibration) return Forward(calibration);
  auto edges = LoadAllEdges(private_nh_, setup_.config, *calibration);
  if (!edges) return Forward(edges);
  setup_.calibration = std::move(*calibration);
  setup_.edges = std::move(*edges);
  static_broadcaster_.sendTransform(setup_.edges);
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
