#include "nodes/backends/replay_motion.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "fringe_fusion/io/scan_folder.hpp"

namespace fringe_fusion::nodes {
namespace {

Result<std::vector<std::vector<double>>> ReadStops(const std::string& path) {
  const Result<ScanFolder> scan = OpenScan(path);
  if (!scan) return Forward(scan);
  std::vector<std::vector<double>> stops;
  for (const int id : scan->view_ids) {
    const Result<ViewDescription> view = ReadViewDescription(*scan, id);
    if (!view) return Forward(view);
    if (view->joint_positions.empty()) {
      return Fail("{}/view.yaml: joint_positions are missing", ViewFolder(*scan, id));
    }
    stops.push_back(view->joint_positions);
  }
  return stops;
}

// Largest difference of one joint; infinite for another number of joints.
double Distance(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.size() != b.size()) return HUGE_VAL;
  double distance = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double difference = std::abs(a[i] - b[i]);
    if (!(difference <= distance)) distance = difference;  // NaN stays.
  }
  return distance;
}

}  // namespace

ReplayMotion::ReplayMotion(ReplayMotionConfig config, std::vector<double> joint_positions)
    : config_(std::move(config)), joint_positions_(std::move(joint_positions)) {}

std::string ReplayMotion::Id() const { return fmt::format("replay of '{}'", config_.scan); }

Status ReplayMotion::MoveTo(const std::vector<double>& joint_positions) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!stops_) {
    Result<std::vector<std::vector<double>>> stops = ReadStops(config_.scan);
    if (!stops) return Fail("{}: {}", Id(), stops.error().message);
    stops_ = std::move(*stops);
  }
  for (const std::vector<double>& stop : *stops_) {
    if (!(Distance(stop, joint_positions) <= config_.tolerance_rad)) continue;
    joint_positions_ = stop;
    return {};
  }
  return Fail("{}: none of its {} views was taken within {} rad of joint positions [{}]", Id(),
              stops_->size(), config_.tolerance_rad, fmt::join(joint_positions, ", "));
}

Result<Motion::State> ReplayMotion::Poll() {
  const std::lock_guard<std::mutex> lock(mutex_);
  State state;
  state.joint_positions = joint_positions_;
  state.joint_velocities.assign(joint_positions_.size(), 0.0);
  state.settled = true;
  return state;
}

}  // namespace fringe_fusion::nodes
