#include "nodes/epipolar_services.hpp"

#include <ros/console.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/constants.hpp"
#include "fringe_fusion/pose/self_calibration.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"

namespace fringe_fusion::nodes {
namespace {

CodedViewsQuery QueryOf(const std::string& scan_id, const std::vector<std::uint32_t>& view_ids) {
  CodedViewsQuery query;
  query.scan_id = scan_id;
  query.view_ids.assign(view_ids.begin(), view_ids.end());
  return query;
}

/// The inverse of T with its covariance: (T Exp(xi))^-1 = T^-1 Exp(-Ad_T xi).
Pose Inverted(const Transform& T, const Matrix6d& covariance) {
  Pose pose;
  pose.T_object_camera = T.inverse();
  const Matrix6d adjoint = Adjoint(T);
  pose.covariance = adjoint * covariance * adjoint.transpose();
  pose.source = PoseSource::kEpipolar;
  return pose;
}

IntrinsicsPrior PriorOf(const IntrinsicsSigma& message) {
  return {message.focal_ratio, message.principal, message.k1};
}

double BaselineOf(const CellCalibration& calibration, double asked_m) {
  return asked_m == 0.0 ? calibration.T_projector_camera.translation().norm() : asked_m;
}

std::vector<Match> MatchesOf(const std::vector<CodedViews::Pointer>& views) {
  std::vector<Match> matches;
  for (const CodedViews::Pointer& view : views) {
    matches.insert(matches.end(), view->matches.begin(), view->matches.end());
  }
  return matches;
}

/// Fills success and message, and tells a failure once.
template <typename Response>
void Answer(const Status& status, const char* service, Response& response) {
  response.success = static_cast<std::uint8_t>(status.has_value());
  if (status) {
    ROS_INFO("%s: %s", service, response.message.c_str());
    return;
  }
  // Nothing of a solution that failed: an identity pose must not be taken for one.
  response = Response();
  response.message = status.error().message;
  ROS_ERROR("%s: %s", service, response.message.c_str());
}

}  // namespace

EpipolarServices::EpipolarServices(ros::NodeHandle nh, const CalibrationWatch::Configs& configs,
                                   CodedViews& views, LitPointsOf lit_points_of)
    : configs_(configs), views_(views), lit_points_of_(std::move(lit_points_of)) {
  relative_pose_server_ =
      nh.advertiseService("estimate_relative_pose", &EpipolarServices::OnRelativePose, this);
  self_calibrate_server_ =
      nh.advertiseService("self_calibrate", &EpipolarServices::OnSelfCalibrate, this);
  view_pose_server_ =
      nh.advertiseService("estimate_view_pose", &EpipolarServices::OnViewPose, this);
}

bool EpipolarServices::OnRelativePose(SolveRelativePose::Request& request,
                                      SolveRelativePose::Response& response) {
  Answer(RelativePoseOf(request, response), "estimate_relative_pose", response);
  return true;
}

bool EpipolarServices::OnSelfCalibrate(SelfCalibrate::Request& request,
                                       SelfCalibrate::Response& response) {
  const auto solve = [&]() -> Status {
    const bool rig = request.layout == "rig";
    if (!rig && request.layout != "projector_fixed" && request.layout != "camera_fixed") {
      return Fail("layout '{}' must be rig, projector_fixed or camera_fixed", request.layout);
    }
    const auto views =
        views_.Wait(QueryOf(request.scan_id, request.view_ids), request.timeout.toSec());
    if (!views) return Forward(views);
    return rig ? CalibrateRig(request, *views, response)
               : CalibrateStations(request, *views, response);
  };
  Answer(solve(), "self_calibrate", response);
  return true;
}

bool EpipolarServices::OnViewPose(SolveViewPose::Request& request,
                                  SolveViewPose::Response& response) {
  Answer(ViewPoseOf(request, response), "estimate_view_pose", response);
  return true;
}

Status EpipolarServices::RelativePoseOf(const SolveRelativePose::Request& request,
                                        SolveRelativePose::Response& response) {
  const auto views =
      views_.Wait(QueryOf(request.scan_id, request.view_ids), request.timeout.toSec());
  if (!views) return Forward(views);
  const CodedView& first = *views->front();
  const CellCalibration& calibration = first.calibration;
  std::optional<Transform> prior;
  if (request.calibration_decides != 0) prior = calibration.T_projector_camera;
  const auto pose = EstimateRelativePose(
      MatchesOf(*views), {calibration.camera, calibration.projector}, configs_.epipolar, prior);
  if (!pose) return Forward(pose);
  const auto metric =
      LiftToMetric(*pose, BaselineOf(calibration, request.baseline), request.baseline_sigma);
  if (!metric) return Forward(metric);
  const RigMotion motion =
      CompareWithReference(*pose, calibration.T_projector_camera, configs_.health);
  response.pose.header.stamp = ros::Time::now();
  response.pose.header.frame_id = first.camera_frame;
  response.pose.pose = ros_io::ToMessage(Inverted(metric->T_observed_anchor, metric->covariance));
  response.num_matches = static_cast<std::uint32_t>(pose->num_matches);
  response.num_inliers = static_cast<std::uint32_t>(pose->num_inliers);
  response.median_residual = pose->median_residual_px;
  response.reduced_chi2 = pose->reduced_chi2;
  response.moved_device = MovedDeviceName(motion.moved);
  response.rotation_change = kRadPerDeg * motion.turn_deg;
  response.direction_change = kRadPerDeg * motion.direction_deg;
  response.significance = motion.significance;
  response.message = fmt::format(
      "{} of {} matches of {} views fit, median distance to the epipolar line {:.3f} px, {:.4f} "
      "deg from the calibration",
      pose->num_inliers, pose->num_matches, views->size(), pose->median_residual_px,
      motion.turn_deg);
  AddFrame(first.camera_frame, first.projector_frame + "_estimated", response.pose.pose.pose);
  return {};
}

Status EpipolarServices::CalibrateRig(const SelfCalibrate::Request& request, const Views& views,
                                      SelfCalibrate::Response& response) {
  const CodedView& first = *views.front();
  const CellCalibration& calibration = first.calibration;
  const auto result =
      SelfCalibratePair(MatchesOf(views), {calibration.camera, calibration.projector},
                        PriorOf(request.camera), PriorOf(request.projector), configs_.epipolar);
  if (!result) return Forward(result);
  const auto metric = LiftToMetric(result->pose, BaselineOf(calibration, request.baseline), 0.0);
  if (!metric) return Forward(metric);
  response.camera_info = ros_io::ToMessage(result->devices.anchor);
  response.projector_info = ros_io::ToMessage(result->devices.observed);
  response.camera_sigma.focal_ratio = result->sigma_focal_anchor_ratio;
  response.projector_sigma.focal_ratio = result->sigma_focal_observed_ratio;
  response.view_ids = {static_cast<std::uint32_t>(first.view_id)};
  response.poses = {ros_io::ToMessage(Inverted(metric->T_observed_anchor, metric->covariance))};
  response.frame_id = first.camera_frame;
  response.reduced_chi2 = result->pose.reduced_chi2;
  response.condition = result->condition;
  response.message = fmt::format(
      "focal lengths {:.1f} and {:.1f} px (sigma {:.2g} % and {:.2g} %) from {} matches of {} "
      "views",
      result->devices.anchor.fx, result->devices.observed.fx,
      100.0 * result->sigma_focal_anchor_ratio, 100.0 * result->sigma_focal_observed_ratio,
      result->pose.num_matches, views.size());
  AddFrame(first.camera_frame, first.projector_frame + "_estimated", response.poses[0].pose);
  return {};
}

Status EpipolarServices::CalibrateStations(const SelfCalibrate::Request& request,
                                           const Views& views, SelfCalibrate::Response& response) {
  const CodedView& first = *views.front();
  const bool camera_moves = request.layout == "projector_fixed";
  std::vector<TrackSet> parts;
  for (const CodedViews::Pointer& view : views) {
    parts.push_back(camera_moves ? view->projector_tracks : view->camera_tracks);
  }
  const auto tracks = MergeTracks(parts);
  if (!tracks) return Forward(tracks);
  const IntrinsicsPrior camera = PriorOf(request.camera);
  const IntrinsicsPrior projector = PriorOf(request.projector);
  const auto result = SolveStations(
      *tracks, camera_moves ? projector : camera, camera_moves ? camera : projector,
      BaselineOf(first.calibration, request.baseline), configs_.epipolar, configs_.stations);
  if (!result) return Forward(result);
  const auto sigma_of = [&](Eigen::Index at) {
    IntrinsicsSigma sigma;
    sigma.focal_ratio = result->sigma_intrinsics[at];
    sigma.principal = std::max(result->sigma_intrinsics[at + 1], result->sigma_intrinsics[at + 2]);
    sigma.k1 = result->sigma_intrinsics[at + 3];
    return sigma;
  };
  const DevicePair& devices = result->devices;
  response.camera_info = ros_io::ToMessage(camera_moves ? devices.observed : devices.anchor);
  response.projector_info = ros_io::ToMessage(camera_moves ? devices.anchor : devices.observed);
  response.camera_sigma = sigma_of(camera_moves ? 4 : 0);
  response.projector_sigma = sigma_of(camera_moves ? 0 : 4);
  response.frame_id = camera_moves ? first.projector_frame : first.camera_frame;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const auto id = static_cast<std::uint32_t>(views[i]->view_id);
    response.view_ids.push_back(id);
    response.poses.push_back(
        ros_io::ToMessage(Inverted(result->T_station_anchor[i], result->covariance[i])));
    AddFrame(response.frame_id, fmt::format("station_{:03}", id), response.poses.back().pose);
  }
  response.reduced_chi2 = result->reduced_chi2;
  response.condition = result->condition;
  response.message =
      fmt::format("{} stations by {} tracks with {} sightings, rms {:.3f} px", views.size(),
                  result->num_tracks, result->num_observations, result->rms_px);
  return {};
}

Status EpipolarServices::ViewPoseOf(const SolveViewPose::Request& request,
                                    SolveViewPose::Response& response) {
  const auto projector = ros_io::FromMessage(request.projector_info, "projector_info");
  if (!projector) return Forward(projector);
  if (request.projector_info.header.frame_id.empty()) {
    return Fail("projector_info: header.frame_id is empty, must be the projector's frame");
  }
  const double timeout_s = request.timeout.toSec();
  const auto views = views_.Wait(QueryOf(request.code_scan_id, {request.code_view_id}), timeout_s);
  if (!views) return Forward(views);
  const auto points =
      lit_points_of_(static_cast<int>(request.view_id), views->front()->matches, timeout_s);
  if (!points) return Forward(points);
  const auto pose = EstimateViewPose(*points, *projector, configs_.epipolar);
  if (!pose) return Forward(pose);
  response.pose.header.stamp = ros::Time::now();
  response.pose.header.frame_id = request.projector_info.header.frame_id;
  Pose found;
  found.T_object_camera = pose->T_projector_rig;
  found.covariance = pose->covariance;
  found.source = PoseSource::kEpipolar;
  response.pose.pose = ros_io::ToMessage(found);
  response.num_points = static_cast<std::uint32_t>(pose->num_points);
  response.num_inliers = static_cast<std::uint32_t>(pose->num_inliers);
  response.rms = pose->rms_px;
  response.reduced_chi2 = pose->reduced_chi2;
  response.message = fmt::format("{} of {} points fit, rms {:.3f} px", pose->num_inliers,
                                 pose->num_points, pose->rms_px);
  AddFrame(response.pose.header.frame_id, fmt::format("view_{:03}_by_projector", request.view_id),
           response.pose.pose.pose);
  return {};
}

void EpipolarServices::AddFrame(const std::string& parent, const std::string& child,
                                const geometry_msgs::Pose& pose) {
  geometry_msgs::TransformStamped frame;
  frame.header.frame_id = parent;
  frame.child_frame_id = child;
  frame.transform.translation.x = pose.position.x;
  frame.transform.translation.y = pose.position.y;
  frame.transform.translation.z = pose.position.z;
  frame.transform.rotation = pose.orientation;
  {
    const std::lock_guard<std::mutex> lock(frames_mutex_);
    frames_[child] = frame;
  }
  BroadcastFrames();
}

void EpipolarServices::BroadcastFrames() {
  const std::lock_guard<std::mutex> lock(frames_mutex_);
  std::vector<geometry_msgs::TransformStamped> frames;
  for (auto& [child, frame] : frames_) {
    frame.header.stamp = ros::Time::now();
    frames.push_back(frame);
  }
  if (!frames.empty()) tf_broadcaster_.sendTransform(frames);
}

void EpipolarServices::Clear() {
  const std::lock_guard<std::mutex> lock(frames_mutex_);
  frames_.clear();
}

}  // namespace fringe_fusion::nodes
