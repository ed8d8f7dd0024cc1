#include "nodes/pose_node.hpp"

#include <fringe_fusion/StageState.h>
#include <fringe_fusion/ViewStatus.h>
#include <ros/console.h>

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>
#include <vector>

#include "fringe_fusion/ros_io/configs.hpp"
#include "fringe_fusion/ros_io/frame_messages.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"
#include "fringe_fusion/ros_io/tf_lookup.hpp"
#include "fringe_fusion/ros_io/view_messages.hpp"

namespace fringe_fusion::nodes {
namespace {
using Clock = std::chrono::steady_clock;

Result<CalibrationWatch::Configs> LoadEpipolar(const ros::NodeHandle& private_nh) {
  const auto epipolar = ros_io::LoadConfig<EpipolarConfig>(ros::NodeHandle(private_nh, "epipolar"));
  if (!epipolar) return Forward(epipolar);
  if (Status status = Validate(*epipolar); !status) return Forward(status);
  const auto health = ros_io::LoadConfig<HealthConfig>(ros::NodeHandle(private_nh, "health"));
  if (!health) return Forward(health);
  const auto stations = ros_io::LoadConfig<StationsConfig>(ros::NodeHandle(private_nh, "stations"));
  if (!stations) return Forward(stations);
  return CalibrationWatch::Configs{*epipolar, *health, *stations};
}
}  // namespace

Result<std::unique_ptr<PoseNode>> PoseNode::Create(ros::NodeHandle nh, ros::NodeHandle private_nh) {
  const auto node = ros_io::LoadConfig<PoseNodeConfig>(private_nh);
  if (!node) return Forward(node);
  const auto prior =
      ros_io::LoadConfig<ros_io::PosePriorConfig>(ros::NodeHandle(private_nh, "prior"));
  if (!prior) return Forward(prior);
  const auto registration =
      ros_io::LoadConfig<RegistrationConfig>(ros::NodeHandle(private_nh, "registration"));
  if (!registration) return Forward(registration);
  const auto epipolar = LoadEpipolar(private_nh);
  if (!epipolar) return Forward(epipolar);
  const Configs configs{*node, *prior, *registration, *epipolar};
  return std::unique_ptr<PoseNode>(new PoseNode(std::move(nh), std::move(private_nh), configs));
}

PoseNode::PoseNode(ros::NodeHandle nh, ros::NodeHandle private_nh, const Configs& configs)
    : configs_(configs),
      nh_(std::move(nh)),
      tf_buffer_(ros::Duration(configs.node.tf_cache_s)),
      tf_listener_(tf_buffer_, nh_),
      coded_views_(static_cast<std::size_t>(configs.node.max_coded_views)),
      epipolar_services_(nh_, configs.epipolar, coded_views_,
                         [this](int view_id, const std::vector<Match>& matches, double timeout_s) {
                           return LitPointsOf(view_id, matches, timeout_s);
                         }),
      calibration_watch_(nh_, private_nh, configs.epipolar, coded_views_) {
  view_publisher_ = nh_.advertise<RangeView>("view", 4);
  poses_publisher_ = nh_.advertise<ViewPoses>("view_poses", 1, /*latch=*/true);
  state_publisher_ = nh_.advertise<StageState>("pose_state", 1, /*latch=*/true);
  status_publisher_ = nh_.advertise<ViewStatus>("view_status", 100);
  optimize_server_ = nh_.advertiseService("optimize_views", &PoseNode::OnOptimize, this);
  reset_server_ = private_nh.advertiseService("reset", &PoseNode::OnReset, this);
  frames_timer_ = nh_.createTimer(ros::Duration(1.0 / configs_.node.view_frames_rate_hz),
                                  [this](const ros::TimerEvent& /*event*/) {
                                    const std::lock_guard<std::mutex> lock(mutex_);
                                    BroadcastViewFrames();
                                    epipolar_services_.BroadcastFrames();
                                  });
  priors_subscriber_ = nh_.subscribe<ViewPoses>(
      "view_priors", 100, [this](const ViewPoses::ConstPtr& message) { OnPriors(*message); });
  range_view_subscriber_ = nh_.subscribe<RangeView>(
      "range_view", 4, [this](const RangeView::ConstPtr& message) { OnRangeView(*message); });
  const std::lock_guard<std::mutex> lock(mutex_);
  PublishState();
}

void PoseNode::OnRangeView(const RangeView& message) {
  const auto start = Clock::now();
  const Result<int> num_points = AcceptView(message);
  ViewStatus status;
  status.header = message.header;
  status.scan_id = message.scan_id;
  status.view_id = message.view_id;
  status.stage = "pose";
  status.success = static_cast<std::uint8_t>(num_points.has_value());
  status.duration = std::chrono::duration<double>(Clock::now() - start).count();
  if (num_points) {
    status.num_points = static_cast<std::uint32_t>(*num_points);
  } else {
    status.message = num_points.error().message;
    ROS_ERROR("view %u of scan '%s' is refused: %s", message.view_id, message.scan_id.c_str(),
              status.message.c_str());
  }
  status_publisher_.publish(status);
}

Result<int> PoseNode::AcceptView(const RangeView& message) {
  Result<View> view = ros_io::FromMessage(message);
  if (!view) return Forward(view);
  Result<Pose> prior = PriorOf(message);
  if (!prior) return Forward(prior);
  view->pose = std::move(*prior);
  if (Status status = Validate(*view); !status) return tl::unexpected<Error>(status.error());
  const int num_points = CountValid(view->range);

  // The points travel on as they came; only the pose is new.
  RangeView posed = message;
  posed.pose_source = PoseSourceName(view->pose.source);
  posed.pose.header.stamp = message.header.stamp;
  posed.pose.header.frame_id = configs_.node.object_frame;
  posed.pose.pose = ros_io::ToMessage(view->pose);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (message.scan_id != scan_id_) StartScan(message.scan_id);
    capture_delay_ = ros::Time::now() - message.header.stamp;
    view_frames_[view->id] = view->pose.T_object_camera;
    const int id = view->id;
    views_.insert_or_assign(id, std::move(*view));
    BroadcastViewFrames();
    PublishState();
  }
  view_publisher_.publish(posed);
  views_changed_.notify_all();
  return num_points;
}

Result<Pose> PoseNode::PriorOf(const RangeView& message) {
  // A resumed scan brings its priors along: tf no longer knows those stamps.
  const std::optional<Transform> from_file = PriorFromFile(message);
  if (from_file) return ros_io::PriorPose(*from_file, configs_.prior, PoseSource::kFile);
  const Result<Transform> from_tf = ros_io::LookupTransform(
      tf_buffer_, {configs_.node.object_frame, message.header.frame_id, message.header.stamp},
      configs_.node.tf_timeout_s);
  if (!from_tf) return Forward(from_tf);
  return ros_io::PriorPose(*from_tf, configs_.prior, PoseSource::kTf);
}

std::optional<Transform> PoseNode::PriorFromFile(const RangeView& message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto prior = file_priors_.find(static_cast<int>(message.view_id));
  if (message.scan_id != file_priors_scan_id_ || prior == file_priors_.end()) return std::nullopt;
  return prior->second;
}

void PoseNode::OnPriors(const ViewPoses& message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (message.scan_id != file_priors_scan_id_) file_priors_.clear();
  file_priors_scan_id_ = message.scan_id;
  for (const ViewPose& view : message.views) {
    const Result<Transform> T = ros_io::FromMessage(view.pose.pose);
    if (!T) {
      ROS_ERROR_THROTTLE(5.0, "prior of view %u of scan '%s' is refused: %s", view.view_id,
                         message.scan_id.c_str(), T.error().message.c_str());
      continue;
    }
    file_priors_[static_cast<int>(view.view_id)] = *T;
  }
}

Result<std::vector<LitPoint>> PoseNode::LitPointsOf(int view_id, const std::vector<Match>& matches,
                                                    double timeout_s) {
  std::unique_lock<std::mutex> lock(mutex_);
  const bool there =
      views_changed_.wait_for(lock, std::chrono::duration<double>(std::max(0.0, timeout_s)),
                              [&] { return views_.count(view_id) > 0; });
  if (!there) return Fail("no view {} among the {} of scan '{}'", view_id, views_.size(), scan_id_);
  return MakeLitPoints(views_.at(view_id).range, matches);
}

bool PoseNode::OnOptimize(OptimizeViews::Request& request, OptimizeViews::Response& response) {
  const Result<RegistrationResult> result = Register(request);
  response.success = static_cast<std::uint8_t>(result.has_value());
  if (!result) {
    response.message = result.error().message;
    ROS_ERROR("registration failed: %s", response.message.c_str());
    return true;
  }
  response.rms_before = result->rms_before_m;
  response.rms_after = result->rms_after_m;
  const auto num_loose = std::count_if(result->views.begin(), result->views.end(),
                                       [](const RegisteredView& view) { return !view.connected; });
  response.message =
      fmt::format("{} views registered in {} iterations{}, {} without overlap keep their prior",
                  result->views.size(), result->iterations,
                  result->converged ? "" : " (not converged)", num_loose);
  for (const std::string& warning : result->warnings) {
    response.message += "; " + warning;
    response.warnings.push_back(warning);
    ROS_WARN("registration: %s", warning.c_str());
  }
  ROS_INFO("%s; rms %.4g -> %.4g mm", response.message.c_str(), 1e3 * result->rms_before_m,
           1e3 * result->rms_after_m);
  const std::lock_guard<std::mutex> lock(mutex_);
  response.poses = Announce(*result);
  return true;
}

Result<RegistrationResult> PoseNode::Register(const OptimizeViews::Request& request) {
  const double timeout_s = std::max(configs_.node.optimize_min_timeout_s, request.timeout.toSec());
  std::unique_lock<std::mutex> lock(mutex_);
  const bool complete = views_changed_.wait_for(
      lock, std::chrono::duration<double>(timeout_s),
      [&] { return !views_.empty() && views_.size() >= request.num_views; });
  if (!complete) {
    return Fail("only {} of {} views of scan '{}' have arrived within {:.3g} s", views_.size(),
                std::max(1U, request.num_views), scan_id_, timeout_s);
  }
  ViewGraph graph;
  graph.views.reserve(views_.size());
  for (const auto& [id, view] : views_) graph.views.push_back(view);
  lock.unlock();  // Views of a next scan may come in while this one is solved.
  return RegisterViews(graph, configs_.registration);
}

ViewPoses PoseNode::Announce(const RegistrationResult& result) {
  ++revision_;
  ViewPoses poses;
  poses.header.stamp = ros::Time::now();
  poses.header.frame_id = configs_.node.object_frame;
  poses.scan_id = scan_id_;
  poses.revision = revision_;
  for (const RegisteredView& view : result.views) {
    poses.views.push_back(ros_io::ToMessage(view));
    if (views_.count(view.id) > 0) view_frames_[view.id] = view.pose.T_object_camera;
  }
  poses_publisher_.publish(poses);
  BroadcastViewFrames();
  return poses;
}

bool PoseNode::OnReset(std_srvs::Trigger::Request& /*request*/,
                       std_srvs::Trigger::Response& response) {
  const std::lock_guard<std::mutex> lock(mutex_);
  response.message = fmt::format("{} views of scan '{}' forgotten", views_.size(), scan_id_);
  response.success = 1;
  file_priors_.clear();
  StartScan("");
  coded_views_.Clear();
  epipolar_services_.Clear();
  // Latched: no one who comes later shall take the poses of a scan that is over.
  ViewPoses none;
  none.header.frame_id = configs_.node.object_frame;
  poses_publisher_.publish(none);
  PublishState();
  return true;
}

void PoseNode::StartScan(const std::string& scan_id) {
  scan_id_ = scan_id;
  views_.clear();
  view_frames_.clear();
}

void PoseNode::PublishState() {
  StageState state;
  state.header.stamp = ros::Time::now();
  state.header.frame_id = configs_.node.object_frame;
  state.stage = "pose";
  state.scan_id = scan_id_;
  state.pose_revision = revision_;
  for (const auto& entry : views_) {
    state.view_ids.push_back(static_cast<std::uint32_t>(entry.first));
  }
  state_publisher_.publish(state);
}

void PoseNode::BroadcastViewFrames() {
  // Broadcast again and again instead of once as static: so they fade from tf after a reset. In
  // the time of the captures: the tf of a bag would else always be older than these frames.
  std::vector<geometry_msgs::TransformStamped> frames;
  for (const auto& [id, T_object_camera] : view_frames_) {
    geometry_msgs::TransformStamped frame;
    frame.header.stamp = ros::Time::now() - capture_delay_;
    frame.header.frame_id = configs_.node.object_frame;
    frame.child_frame_id = fmt::format("view_{:03}", id);
    frame.transform = ros_io::ToTransformMessage(T_object_camera);
    frames.push_back(frame);
  }
  if (!frames.empty()) tf_broadcaster_.sendTransform(frames);
}

}  // namespace fringe_fusion::nodes
