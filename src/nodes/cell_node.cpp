#include "nodes/cell_node.hpp"

#include <fringe_fusion/ExtractSurface.h>
#include <fringe_fusion/Frame.h>
#include <ros/console.h>
#include <std_srvs/Trigger.h>

#include <algorithm>
#include <utility>

#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/ros_io/configs.hpp"
#include "fringe_fusion/ros_io/finding_messages.hpp"
#include "fringe_fusion/ros_io/frame_messages.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"
#include "fringe_fusion/ros_io/service_call.hpp"

namespace fringe_fusion::nodes {
namespace {

/// Adds the time from its birth to its death to a sum.
class Stopwatch {
 public:
  explicit Stopwatch(double& sum_s) : sum_s_(sum_s) {}
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;
  ~Stopwatch() {
    sum_s_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  double& sum_s_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

std::string ScanFolderOf(const std::string& output_folder) { return output_folder + "/scan"; }

std::string IdFromTime() {
  return fmt::format("scan_{}", ros::WallTime::now().toNSec() / 1000000U);
}

/// Views that are complete on disk; none if there is no scan yet.
std::vector<int> ViewsOnDisk(const std::string& output_folder) {
  const Result<ScanFolder> scan = OpenScan(ScanFolderOf(output_folder));
  return scan ? scan->view_ids : std::vector<int>{};
}

}  // namespace

Result<std::unique_ptr<CellNode>> CellNode::Create(ros::NodeHandle nh, ros::NodeHandle private_nh) {
  const auto config = ros_io::LoadConfig<CellNodeConfig>(private_nh);
  if (!config) return Forward(config);
  const auto num_joints = ros_io::RequiredParameter<int>(private_nh, "num_joints");
  if (!num_joints) return Forward(num_joints);
  const auto positions =
      ros_io::RequiredParameter<std::vector<double>>(private_nh, "joint_positions");
  if (!positions) return Forward(positions);
  if (*num_joints < 1 || positions->size() % static_cast<std::size_t>(*num_joints) != 0) {
    return Fail("parameter {}: {} values are not a multiple of num_joints = {}",
                private_nh.resolveName("joint_positions"), positions->size(), *num_joints);
  }
  const auto phase = ros_io::LoadConfig<PhaseConfig>(ros::NodeHandle(private_nh, "phase"));
  if (!phase) return Forward(phase);
  const auto diagnosis =
      ros_io::LoadConfig<DiagnosisConfig>(ros::NodeHandle(private_nh, "diagnosis"));
  if (!diagnosis) return Forward(diagnosis);
  return std::unique_ptr<CellNode>(
      new CellNode(std::move(nh), {*config, *phase, *diagnosis, *positions, *num_joints}));
}

CellNode::CellNode(ros::NodeHandle nh, Setup setup)
    : setup_(std::move(setup)),
      config_(setup_.config),
      nh_(std::move(nh)),
      client_nh_(WithQueue(nh_, client_queue_)),
      move_client_(client_nh_, "move_to_view", /*spin_thread=*/false),
      scan_client_(client_nh_, "scan_view", /*spin_thread=*/false),
      server_(
          nh_, "scan_object", [this](const ScanObjectGoalConstPtr& goal) { Execute(*goal); },
          /*auto_start=*/false) {
  frame_publisher_ =
      nh_.advertise<Frame>("frames", static_cast<std::uint32_t>(config_.frame_queue_size));
  prior_publisher_ = nh_.advertise<ViewPoses>("view_priors", 100);
  status_subscriber_ = nh_.subscribe<ViewStatus>(
      "view_status", 100, [this](const ViewStatus::ConstPtr& m) { tracker_.OnStatus(*m); });
  const auto on_state = [this](const StageState::ConstPtr& m) { tracker_.OnState(*m); };
  pose_state_subscriber_ = nh_.subscribe<StageState>("pose_state", 100, on_state);
  model_state_subscriber_ = nh_.subscribe<StageState>("model_state", 100, on_state);
  server_.start();
}

CellNode::~CellNode() {
  stopping_ = true;
  server_.shutdown();
}

void CellNode::Execute(const ScanObjectGoal& goal) {
  ScanObjectResult result;
  const Result<Run> run = Scan(goal);
  if (!run) {
    // Motion first: whatever went wrong, nothing moves on.
    move_client_.cancelAllGoals();
    scan_client_.cancelAllGoals();
    result.success = 0;
    result.message = run.error().message;
    if (server_.isNewGoalAvailable()) {
      result.message = "another goal has taken the place of this scan; its frames are on disk";
      ROS_WARN("%s: %s", goal.output_folder.c_str(), result.message.c_str());
      server_.setPreempted(result, result.message);
    } else if (Cancelled()) {
      ROS_INFO("scan cancelled; the frames taken so far are in %s", goal.output_folder.c_str());
      server_.setPreempted(result, result.message);
    } else {
      ROS_ERROR("scan failed: %s", result.message.c_str());
      server_.setAborted(result, result.message);
    }
    return;
  }
  result.success = 1;
  result.num_views = static_cast<std::uint32_t>(run->figures.views.size());
  result.num_points = static_cast<std::uint32_t>(run->figures.NumPoints());
  result.mesh_path = run->folder + "/mesh.ply";
  result.rms_before = run->figures.rms_before_m;
  result.rms_after = run->figures.rms_after_m;
  for (const auto& entry : run->findings) {
    result.findings.insert(result.findings.end(), entry.second.begin(), entry.second.end());
  }
  result.message =
      fmt::format("{} views, {} points: {}", result.num_views, result.num_points, result.mesh_path);
  ROS_INFO("scan done: %s", result.message.c_str());
  server_.setSucceeded(result);
}

Result<CellNode::Run> CellNode::Scan(const ScanObjectGoal& goal) {
  Result<Run> run = Prepare(goal);
  if (!run) return run;
  const auto failed = [](const Status& status) { return tl::unexpected<Error>(status.error()); };
  OptimizeViews::Response registered;
  {
    const Stopwatch total(run->seconds["total"]);
    if (Status status = CaptureViews(*run); !status) return failed(status);
    if (run->job.num_views > 1) {
      const auto response = Register(*run);
      if (!response) return Forward(response);
      registered = *response;
    }
    if (Status status = ExtractMesh(*run, registered.poses.revision); !status) {
      return failed(status);
    }
  }
  run->figures.rms_before_m = registered.rms_before;
  run->figures.rms_after_m = registered.rms_after;
  run->figures.warnings = registered.warnings;
  Feedback(*run, "writing the report", 0.99);
  if (Status status = WriteOutput(*run, registered.poses); !status) return failed(status);
  return run;
}

Result<CellNode::Run> CellNode::Prepare(const ScanObjectGoal& goal) {
  Run run;
  run.folder = goal.output_folder;
  run.resume = goal.resume != 0;
  if (run.folder.empty()) return Fail("output_folder is empty");
  if (Status status = MakeFolder(run.folder); !status) {
    return tl::unexpected<Error>(status.error());
  }
  const std::vector<int> on_disk = ViewsOnDisk(run.folder);
  if (run.resume) {
    const Result<ScanJob> job = ReadJob(run.folder);
    if (!job) return Fail("nothing to resume: {}", job.error().message);
    run.job = *job;
    if (goal.num_views != 0 && static_cast<int>(goal.num_views) != job->num_views) {
      return Fail("{}/job.yaml is a scan of {} views, the goal asks for {}", run.folder,
                  job->num_views, goal.num_views);
    }
  } else {
    if (!on_disk.empty()) {
      return Fail("{} holds {} views already: resume that scan or choose another folder",
                  ScanFolderOf(run.folder), on_disk.size());
    }
    run.job.scan_id = goal.scan_id.empty() ? IdFromTime() : goal.scan_id;
    run.job.num_views = goal.num_views == 0 ? config_.num_views : static_cast<int>(goal.num_views);
  }
  const std::size_t num_stops =
      setup_.joint_positions.size() / static_cast<std::size_t>(setup_.num_joints);
  if (num_stops > 0 && static_cast<std::size_t>(run.job.num_views) > num_stops) {
    return Fail("{} views are more than the {} stops in joint_positions", run.job.num_views,
                num_stops);
  }
  if (Status status = WriteJob(run.job, run.folder); !status) {
    return tl::unexpected<Error>(status.error());
  }
  tracker_.Begin(run.job.scan_id);
  Feedback(run, "waiting for the nodes", 0.0);
  if (Status status = ResetStages(); !status) return tl::unexpected<Error>(status.error());
  tracker_.Begin(run.job.scan_id);
  missing_since_.clear();
  run.figures.job = run.job;
  return run;
}

Status CellNode::ResetStages() {
  for (const char* service : {"pose_node/reset", "fusion_node/reset"}) {
    const std::string name = nh_.resolveName(service);
    const auto deadline = Clock::now() + std::chrono::duration<double>(config_.server_timeout_s);
    while (!ros::service::exists(name, /*print_failure_reason=*/false)) {
      if (Cancelled()) return Fail("{}", kCancelled);
      if (Clock::now() >= deadline) {
        return Fail("service {} is not there within {:.3g} s: check that its node runs", name,
                    config_.server_timeout_s);
      }
      ros::WallDuration(0.05).sleep();
    }
    const auto reset = ros_io::CallService<std_srvs::Trigger>(
        nh_, service, std_srvs::Trigger::Request(), config_.server_timeout_s);
    if (!reset) return tl::unexpected<Error>(reset.error());
  }
  return {};
}

Status CellNode::CaptureViews(Run& run) {
  const std::vector<int> on_disk = ViewsOnDisk(run.folder);
  for (int view_id = 0; view_id < run.job.num_views; ++view_id) {
    const auto limit = static_cast<std::size_t>(config_.max_views_in_flight - 1);
    if (Status status = WaitForModel(run, limit); !status) return status;
    Status taken;
    if (std::find(on_disk.begin(), on_disk.end(), view_id) != on_disk.end()) {
      taken = SendFromDisk(run, view_id);
    } else {
      taken = CaptureView(run, view_id);
    }
    if (!taken) return taken;
  }
  const Stopwatch watch(run.seconds["waiting for the model"]);
  return WaitForModel(run, 0);
}

Status CellNode::CaptureView(Run& run, int view_id) {
  const auto progress = 0.9 * view_id / run.job.num_views;
  const auto cancelled = [this] { return Cancelled(); };
  {
    const Stopwatch watch(run.seconds["moving"]);
    Feedback(run, fmt::format("moving to view {}", view_id), progress);
    MoveToViewGoal move;
    move.joint_positions = Stop(view_id, run.job.num_views);
    const auto moved =
        RunGoal<MoveToViewResult>(move_client_, client_queue_, move, "move_to_view",
                                  {config_.server_timeout_s, config_.move_timeout_s}, cancelled);
    if (!moved) return tl::unexpected<Error>(moved.error());
  }
  const Stopwatch watch(run.seconds["capturing"]);
  Feedback(run, fmt::format("capturing view {}", view_id), progress);
  ScanViewGoal scan;
  scan.scan_id = run.job.scan_id;
  scan.view_id = static_cast<std::uint32_t>(view_id);
  scan.scan_folder = ScanFolderOf(run.folder);
  const auto scanned =
      RunGoal<ScanViewResult>(scan_client_, client_queue_, scan, "scan_view",
                              {config_.server_timeout_s, config_.view_timeout_s}, cancelled);
  if (!scanned) return tl::unexpected<Error>(scanned.error());
  run.findings[view_id] = scanned->findings;
  tracker_.Sent(view_id);
  return {};
}

std::vector<double> CellNode::Stop(int view_id, int num_views) const {
  if (setup_.joint_positions.empty()) {
    std::vector<double> positions(static_cast<std::size_t>(setup_.num_joints), 0.0);
    positions.front() = 2.0 * 3.14159265358979323846 * view_id / num_views;
    return positions;
  }
  const auto first = setup_.joint_positions.begin() + view_id * setup_.num_joints;
  return {first, first + setup_.num_joints};
}

Status CellNode::WaitForModel(Run& run, std::size_t num_in_flight) {
  while (true) {
    if (Cancelled()) return Fail("{}", kCancelled);
    if (const auto refusal = tracker_.Refusal()) return Fail("{}", *refusal);
    if (Status status = CheckNodes(); !status) return status;
    const std::vector<int> lost = tracker_.Lost();
    if (!lost.empty()) {
      ROS_WARN("a node was restarted and holds %zu views no more: sent again from %s", lost.size(),
               ScanFolderOf(run.folder).c_str());
      if (Status status = Resend(run, lost); !status) return status;
      continue;
    }
    const auto process_timeout = std::chrono::duration_cast<Clock::duration>(
        std::chrono::duration<double>(config_.process_timeout_s));
    const std::vector<int> overdue = tracker_.Overdue(Clock::now() - process_timeout);
    if (!overdue.empty()) {
      ROS_WARN("view %d is not in the model %.3g s after its capture: sent again from %s",
               overdue.front(), config_.process_timeout_s, ScanFolderOf(run.folder).c_str());
      if (Status status = Resend(run, overdue); !status) return status;
      continue;
    }
    if (tracker_.InFlight().size() <= num_in_flight) return {};
    tracker_.WaitForNews(std::chrono::milliseconds(100));
  }
}

Status CellNode::Resend(Run& run, const std::vector<int>& view_ids) {
  for (const int id : view_ids) {
    if (++run.num_resends[id] > config_.max_resends) {
      return Fail(
          "view {} has not reached the model after {} resends of its frames: check the logs of "
          "phase_node, pose_node and fusion_node",
          id, config_.max_resends);
    }
    if (Cancelled()) return Fail("{}", kCancelled);
    if (Status status = SendFromDisk(run, id); !status) return status;
    // One at a time: the queues hold few views.
    const auto deadline = Clock::now() + std::chrono::duration<double>(config_.process_timeout_s);
    while (!Cancelled() && Clock::now() < deadline && !tracker_.Refusal()) {
      const std::vector<int> in_flight = tracker_.InFlight();
      if (std::find(in_flight.begin(), in_flight.end(), id) == in_flight.end()) break;
      if (Status status = CheckNodes(); !status) return status;
      tracker_.WaitForNews(std::chrono::milliseconds(100));
    }
  }
  return {};
}

Status CellNode::SendFromDisk(Run& run, int view_id) {
  Feedback(run, fmt::format("sending view {} from disk", view_id),
           0.9 * view_id / run.job.num_views);
  const Result<ScanFolder> scan = OpenScan(ScanFolderOf(run.folder));
  if (!scan) return tl::unexpected<Error>(scan.error());
  const Result<ViewDescription> description = ReadViewDescription(*scan, view_id);
  if (!description) return tl::unexpected<Error>(description.error());
  Result<ImageStack> stack = ReadStack(*scan, view_id);
  if (!stack) return tl::unexpected<Error>(stack.error());
  stack->scan_id = run.job.scan_id;
  stack->view_id = view_id;
  if (description->prior) {
    ViewPoses priors;
    priors.header.frame_id = config_.object_frame;
    priors.scan_id = run.job.scan_id;
    ViewPose prior;
    prior.view_id = static_cast<std::uint32_t>(view_id);
    prior.pose_source = PoseSourceName(PoseSource::kFile);
    prior.pose = ros_io::ToMessage(*description->prior);
    priors.views.push_back(prior);
    prior_publisher_.publish(priors);
  }
  tracker_.Sent(view_id);
  for (std::size_t i = 0; i < stack->frames.size(); ++i) {
    frame_publisher_.publish(ros_io::ToMessage(*stack, i, config_.camera_frame));
  }
  // A view of an interrupted scan: what was found then is forgotten.
  if (run.findings.count(view_id) == 0) {
    const auto diagnosis = DiagnoseStack(*stack, setup_.phase, setup_.diagnosis, scan->calibration);
    if (diagnosis) run.findings[view_id] = ros_io::ToMessages(*diagnosis, view_id);
  }
  return {};
}

Status CellNode::CheckNodes() {
  const auto now = Clock::now();
  const auto check = [&](const std::string& what, bool there) -> Status {
    if (there) {
      missing_since_.erase(what);
      return {};
    }
    const auto since = missing_since_.emplace(what, now).first->second;
    if (now - since < std::chrono::duration<double>(config_.server_timeout_s)) return {};
    return Fail("{} has been gone for {:.3g} s; the frames are on disk: start it and resume", what,
                config_.server_timeout_s);
  };
  if (Status status = check("phase_node", frame_publisher_.getNumSubscribers() > 0); !status) {
    return status;
  }
  if (Status status = check("pose_node", pose_state_subscriber_.getNumPublishers() > 0); !status) {
    return status;
  }
  return check("fusion_node", model_state_subscriber_.getNumPublishers() > 0);
}

Result<OptimizeViews::Response> CellNode::Register(Run& run) {
  const Stopwatch watch(run.seconds["registration"]);
  Feedback(run, "registering all views", 0.9);
  OptimizeViews::Request request;
  request.num_views = static_cast<std::uint32_t>(run.job.num_views);
  request.timeout = ros::Duration(config_.server_timeout_s);
  return ros_io::CallService<OptimizeViews>(nh_, "optimize_views", request,
                                            config_.optimize_timeout_s);
}

Status CellNode::ExtractMesh(Run& run, std::uint32_t pose_revision) {
  const Stopwatch watch(run.seconds["fusion and mesh"]);
  Feedback(run, "extracting the mesh", 0.95);
  ExtractSurface::Request request;
  request.path = run.folder + "/mesh.ply";
  request.scan_id = run.job.scan_id;
  request.num_views = static_cast<std::uint32_t>(run.job.num_views);
  request.pose_revision = pose_revision;
  request.timeout = ros::Duration(config_.process_timeout_s);
  request.fill_holes = static_cast<std::uint8_t>(config_.fill_holes);
  auto surface =
      ros_io::CallService<ExtractSurface>(nh_, "extract_mesh", request, config_.extract_timeout_s);
  if (!surface) {
    // The node may have been restarted since the last view: then its views are sent again, once.
    ROS_WARN("%s", surface.error().message.c_str());
    if (Status status = WaitForModel(run, 0); !status) return status;
    surface = ros_io::CallService<ExtractSurface>(nh_, "extract_mesh", request,
                                                  config_.extract_timeout_s);
  }
  if (!surface) return tl::unexpected<Error>(surface.error());
  run.figures.num_vertices = static_cast<int>(surface->num_vertices);
  run.figures.num_faces = static_cast<int>(surface->num_faces);
  for (const ViewStatus& status : surface->views) {
    ScanFigures::View& view = run.views[static_cast<int>(status.view_id)];
    view.num_points = static_cast<int>(status.num_points);
    view.num_dropped = static_cast<int>(status.num_dropped);
  }
  return {};
}

Status CellNode::WriteOutput(Run& run, const ViewPoses& poses) {
  const Result<std::map<int, Transform>> priors = PriorPoses(run);
  if (!priors) return tl::unexpected<Error>(priors.error());
  Result<std::map<int, Transform>> solved = PosesOf(poses);
  if (!solved) return tl::unexpected<Error>(solved.error());
  if (solved->empty()) solved = *priors;  // A single view: there was nothing to register.
  if (Status status = WritePoses(*priors, run.folder + "/poses_prior.conf"); !status) {
    return status;
  }
  if (Status status = WritePoses(*solved, run.folder + "/poses.conf"); !status) return status;

  for (const auto& [id, progress] : tracker_.Views()) {
    run.views[id].id = id;
    run.seconds["phase (in parallel)"] += progress.phase_s;
    run.seconds["fusion of views (in parallel)"] += progress.fusion_s;
  }
  for (const ViewPose& pose : poses.views) {
    ScanFigures::View& view = run.views[static_cast<int>(pose.view_id)];
    view.overlap_ratio = pose.overlap;
    view.rms_m = pose.rms;
    view.connected = pose.connected != 0;
  }
  for (const auto& [id, findings] : run.findings) {
    for (const CaptureFinding& finding : findings) {
      run.views[id].findings.push_back({finding.name, finding.evidence, finding.advice});
    }
  }
  for (const auto& entry : run.views) run.figures.views.push_back(entry.second);
  run.figures.seconds.assign(run.seconds.begin(), run.seconds.end());
  if (Status status = WriteFigures(run.figures, run.folder + "/figures.json"); !status) {
    return status;
  }
  return WriteScanReport(run.figures, run.folder);
}

Result<std::map<int, Transform>> CellNode::PriorPoses(const Run& run) const {
  const Result<ScanFolder> scan = OpenScan(ScanFolderOf(run.folder));
  if (!scan) return Forward(scan);
  std::map<int, Transform> poses;
  for (int id = 0; id < run.job.num_views; ++id) {
    const Result<ViewDescription> description = ReadViewDescription(*scan, id);
    if (!description) return Forward(description);
    if (description->prior) poses[id] = description->prior->T_object_camera;
  }
  return poses;
}

void CellNode::Feedback(const Run& run, const std::string& state, double progress) {
  ScanObjectFeedback feedback;
  feedback.state = state;
  feedback.num_views = static_cast<std::uint32_t>(run.job.num_views);
  const auto in_flight = tracker_.InFlight().size();
  const auto known = tracker_.Views().size();
  feedback.view = static_cast<std::uint32_t>(known > in_flight ? known - in_flight : 0);
  feedback.progress = progress;
  server_.publishFeedback(feedback);
}

bool CellNode::Cancelled() { return stopping_ || server_.isPreemptRequested() || !ros::ok(); }

}  // namespace fringe_fusion::nodes
