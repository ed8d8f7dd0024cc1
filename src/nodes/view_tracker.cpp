#include "nodes/view_tracker.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace fringe_fusion::nodes {
namespace {
constexpr const char* kStages[] = {"pose", "fusion"};
}  // namespace

void ViewTracker::Begin(const std::string& scan_id) {
  const std::lock_guard<std::mutex> lock(mutex_);
  scan_id_ = scan_id;
  sent_.clear();
  views_.clear();
  refusal_.reset();
  stages_.clear();
}

void ViewTracker::Sent(int view_id) {
  const std::lock_guard<std::mutex> lock(mutex_);
  sent_[view_id] = Clock::now();
  for (auto& entry : stages_) entry.second.lost.erase(view_id);
}

void ViewTracker::OnStatus(const ViewStatus& status) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (status.scan_id != scan_id_) return;
  const int id = static_cast<int>(status.view_id);
  if (status.success == 0) {
    refusal_ = fmt::format("view {} was refused by {}: {}", id, status.stage, status.message);
  }
  Progress& view = views_[id];
  if (status.stage == "phase") view.phase_s = status.duration;
  if (status.stage == "pose") view.pose_s = status.duration;
  if (status.stage == "fusion") {
    view.fusion_s = status.duration;
    view.num_points = static_cast<int>(status.num_points);
    view.num_dropped = static_cast<int>(status.num_dropped);
  }
  news_.notify_all();
}

void ViewTracker::OnState(const StageState& state) {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::set<int> held;
  if (state.scan_id == scan_id_) held.insert(state.view_ids.begin(), state.view_ids.end());
  Stage& stage = stages_[state.stage];
  const bool shrunk =
      !std::includes(held.begin(), held.end(), stage.held.begin(), stage.held.end());
  if (shrunk) {
    // The node was restarted: besides what it held, what was on its way to it is gone as well.
    for (const auto& entry : sent_) {
      if (held.count(entry.first) == 0) stage.lost.insert(entry.first);
    }
  }
  stage.held = std::move(held);
  for (const int id : stage.held) stage.lost.erase(id);
  news_.notify_all();
}

void ViewTracker::WaitForNews(std::chrono::milliseconds timeout) {
  std::unique_lock<std::mutex> lock(mutex_);
  news_.wait_for(lock, timeout);
}

bool ViewTracker::HeldByAll(int view_id) const {
  return std::all_of(std::begin(kStages), std::end(kStages), [&](const char* name) {
    const auto stage = stages_.find(name);
    return stage != stages_.end() && stage->second.held.count(view_id) > 0;
  });
}

std::vector<int> ViewTracker::InFlight() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<int> ids;
  for (const auto& entry : sent_) {
    if (!HeldByAll(entry.first)) ids.push_back(entry.first);
  }
  return ids;
}

std::vector<int> ViewTracker::Lost() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::set<int> ids;
  for (const auto& entry : stages_) ids.insert(entry.second.lost.begin(), entry.second.lost.end());
  return {ids.begin(), ids.end()};
}

std::vector<int> ViewTracker::Overdue(Clock::time_point since) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<int> ids;
  for (const auto& [id, sent] : sent_) {
    if (sent < since && !HeldByAll(id)) ids.push_back(id);
  }
  return ids;
}

std::optional<std::string> ViewTracker::Refusal() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return refusal_;
}

std::map<int, ViewTracker::Progress> ViewTracker::Views() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return views_;
}

}  // namespace fringe_fusion::nodes
