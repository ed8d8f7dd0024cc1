#include "nodes/device_task.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "fringe_fusion/ros_io/frame_messages.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"
#include "fringe_fusion/ros_io/tf_lookup.hpp"

namespace fringe_fusion::nodes {
namespace {

geometry_msgs::PoseWithCovarianceStamped StampedPose(const std::string& frame, const Transform& T,
                                                     const Matrix6d& covariance) {
  geometry_msgs::PoseWithCovarianceStamped message;
  message.header.stamp = ros::Time::now();
  message.header.frame_id = frame;
  message.pose = ros_io::ToMessage(Pose{T, covariance, PoseSource::kNone});
  return message;
}

}  // namespace

DeviceTask::DeviceTask(const ros::NodeHandle& nh, DeviceContext context, const tf2_ros::Buffer& tf,
                       CalibrationFiles& files)
    : nh_(nh), context_(std::move(context)), tf_(tf), files_(files) {}

std::vector<std::string> DeviceTask::Names() const {
  std::vector<std::string> names;
  for (const TargetSighting& sighting : sightings_) names.push_back(sighting.name);
  return names;
}

Result<std::string> DeviceTask::Add(const SightedTarget& seen) {
  if (seen.sighting.is_orientation_assumed) {
    return Fail(
        "{}: the target looks the same when it is turned round: it needs marked dots, or another "
        "kind",
        seen.sighting.name);
  }
  const DeviceFrames frames = Frames();
  const auto reading = ros_io::LookupTransform(
      tf_, {frames.rest, frames.moving, ros_io::ToRosTime(seen.stamp_ns)}, context_.tf_timeout_s);
  if (!reading) return Forward(reading);
  sightings_.push_back(seen.sighting);
  readings_.push_back(*reading);
  verdict_.reset();
  return fmt::format("pose '{}', {} points: {} poses", seen.sighting.name,
                     seen.sighting.points.size(), sightings_.size());
}

Result<std::string> DeviceTask::Remove(const std::string& name) {
  if (sightings_.empty()) return Fail("there is no pose to remove");
  auto found = sightings_.end() - 1;
  if (!name.empty()) {
    found = std::find_if(sightings_.begin(), sightings_.end(),
                         [&name](const TargetSighting& known) { return known.name == name; });
  }
  if (found == sightings_.end()) {
    return Fail("there is no pose '{}' among {}", name, fmt::join(Names(), ", "));
  }
  readings_.erase(readings_.begin() + (found - sightings_.begin()));
  sightings_.erase(found);
  verdict_.reset();
  return fmt::format("{} poses are left", sightings_.size());
}

void DeviceTask::Reset() {
  sightings_.clear();
  readings_.clear();
  verdict_.reset();
}

Result<std::string> DeviceTask::Solve(const std::string& /*report_folder*/) {
  verdict_.reset();
  auto verdict = SolvePoses();
  if (!verdict) return Forward(verdict);
  verdict_ = std::move(*verdict);
  return verdict_->words;
}

Result<std::string> DeviceTask::Accept(bool force) {
  if (!verdict_) {
    return Fail("there is no solution of the {} poses: solve first", sightings_.size());
  }
  if (!verdict_->accepted && !force) {
    return Fail("the earlier calibration stays in force: {}", fmt::join(verdict_->reasons, "; "));
  }
  if (context_.edges_file.empty()) {
    return Fail("parameter edges_file is empty: give a file of edges of this cell to put it into");
  }
  const auto earlier = ReadFrameEdges(context_.edges_file);
  if (!earlier) return Forward(earlier);
  const auto edge = Edge(*earlier);
  if (!edge) return Forward(edge);
  std::vector<FrameEdge> edges = *earlier;
  SetFrameEdge(*edge, edges);
  CalibrationFiles::Change change;
  change.paths = {context_.edges_file};
  change.apply = [&]() -> Status {
    if (Status status = WriteFrameEdges(edges, context_.edges_file); !status) return status;
    SetEdges(edges);
    return {};
  };
  change.undo = [&] { SetEdges(*earlier); };
  if (Status status = files_.Put(change); !status) return Forward(status);
  return fmt::format("edge {} of {} in {} is in force: {}", edge->name, edge->child_frame,
                     edge->parent_frame, context_.edges_file);
}

void DeviceTask::SetEdges(const std::vector<FrameEdge>& edges) const {
  const std::string root = context_.scanner_node + "/edges/";
  std::vector<std::string> names;
  for (const FrameEdge& edge : edges) {
    names.push_back(edge.name);
    const Eigen::Vector3d t = edge.T_parent_child.translation();
    const Eigen::Quaterniond q(edge.T_parent_child.rotation());
    nh_.setParam(root + edge.name + "/parent_frame", edge.parent_frame);
    nh_.setParam(root + edge.name + "/child_frame", edge.child_frame);
    nh_.setParam(root + edge.name + "/translation_m", std::vector<double>{t.x(), t.y(), t.z()});
    nh_.setParam(root + edge.name + "/quaternion_xyzw",
                 std::vector<double>{q.x(), q.y(), q.z(), q.w()});
  }
  nh_.setParam(root + "names", names);
}

HandEyeTask::HandEyeTask(const ros::NodeHandle& nh, DeviceContext context,
                         const tf2_ros::Buffer& tf, CalibrationFiles& files, Setup setup)
    : DeviceTask(nh, std::move(context), tf, files), setup_(std::move(setup)) {}

DeviceTask::DeviceFrames HandEyeTask::Frames() const {
  return {setup_.frames.base_frame, setup_.frames.flange_frame};
}

Result<Verdict> HandEyeTask::SolvePoses() {
  std::vector<DevicePose> poses;
  for (std::size_t i = 0; i < readings().size(); ++i) {
    poses.push_back({sightings()[i].name, readings()[i], Matrix6d::Zero()});
  }
  auto result = CalibrateHandEye(poses, sightings(), {context().target, context().devices()},
                                 setup_.mount, setup_.config);
  if (!result) return Forward(result);
  result_ = std::move(*result);
  return result_.verdict;
}

Result<FrameEdge> HandEyeTask::Edge(const std::vector<FrameEdge>& /*edges*/) const {
  return ScannerEdge(result_, setup_.frames.flange_frame, setup_.frames.base_frame);
}

CalibrateHandEyeResult HandEyeTask::Message() const {
  CalibrateHandEyeResult message;
  message.poses = Names();
  message.camera.pose.pose.orientation.w = message.target.pose.pose.orientation.w = 1.0;
  if (!verdict()) return message;
  message.solved = 1;
  message.acceptable = static_cast<std::uint8_t>(verdict()->accepted);
  const bool in_hand = setup_.mount == HandEyeMount::kEyeInHand;
  message.camera = StampedPose(in_hand ? setup_.frames.flange_frame : setup_.frames.base_frame,
                               result_.T_carrier_camera, result_.covariance_camera);
  message.target = StampedPose(in_hand ? setup_.frames.base_frame : setup_.frames.flange_frame,
                               result_.T_other_target, result_.covariance_target);
  message.rms = result_.rms_px;
  message.predicted_error = result_.predicted_error_m;
  return message;
}

TurntableTask::TurntableTask(const ros::NodeHandle& nh, DeviceContext context,
                             const tf2_ros::Buffer& tf, CalibrationFiles& files,
                             TurntableSetup setup, const TurntableConfig& config)
    : DeviceTask(nh, std::move(context), tf, files), setup_(std::move(setup)), config_(config) {}

DeviceTask::DeviceFrames TurntableTask::Frames() const {
  return {setup_.base_frame, setup_.table_frame};
}

Result<Verdict> TurntableTask::SolvePoses() {
  std::vector<TurntableStop> stops;
  for (std::size_t i = 0; i < readings().size(); ++i) {
    // The table turns about z of its base.
    const Eigen::Matrix3d R = readings()[i].rotation();
    stops.push_back({sightings()[i].name, std::atan2(R(1, 0), R(0, 0)), 0.0});
  }
  auto result =
      CalibrateTurntable(stops, sightings(), {context().target, context().devices()}, config_);
  if (!result) return Forward(result);
  result_ = std::move(*result);
  return result_.verdict;
}

Result<FrameEdge> TurntableTask::Edge(const std::vector<FrameEdge>& edges) const {
  const auto known = std::find_if(edges.begin(), edges.end(), [this](const FrameEdge& edge) {
    return edge.child_frame == setup_.base_frame;
  });
  if (known == edges.end()) {
    return Fail("{}: no edge leads to '{}'", context().edges_file, setup_.base_frame);
  }
  const auto T_parent_camera = ros_io::LookupTransform(
      tf(), {known->parent_frame, context().camera_frame, ros::Time()}, context().tf_timeout_s);
  if (!T_parent_camera) return Forward(T_parent_camera);
  return TurntableBaseEdge(result_, *T_parent_camera, known->parent_frame, edges);
}

CalibrateTurntableResult TurntableTask::Message() const {
  CalibrateTurntableResult message;
  message.poses = Names();
  message.turntable_base.pose.pose.orientation.w = 1.0;
  if (!verdict()) return message;
  message.solved = 1;
  message.acceptable = static_cast<std::uint8_t>(verdict()->accepted);
  message.turntable_base =
      StampedPose(context().camera_frame, result_.T_camera_base, result_.covariance_base);
  message.sigma_direction = result_.sigma_direction_rad;
  message.sigma_point = result_.sigma_point_m;
  message.rms = result_.rms_px;
  return message;
}

}  // namespace fringe_fusion::nodes
