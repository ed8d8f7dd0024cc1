#include "nodes/coded_views.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace fringe_fusion::nodes {

void CodedViews::Add(CodedView view) {
  const auto added = std::make_shared<const CodedView>(std::move(view));
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    views_.erase(std::remove_if(views_.begin(), views_.end(),
                                [&](const Pointer& old) {
                                  return old->scan_id == added->scan_id &&
                                         old->view_id == added->view_id;
                                }),
                 views_.end());
    views_.push_back(added);
    if (views_.size() > max_views_) views_.pop_front();
  }
  news_.notify_all();
}

void CodedViews::Clear() {
  const std::lock_guard<std::mutex> lock(mutex_);
  views_.clear();
}

Result<std::vector<CodedViews::Pointer>> CodedViews::Wait(const CodedViewsQuery& query,
                                                          double timeout_s) {
  std::unique_lock<std::mutex> lock(mutex_);
  Result<std::vector<Pointer>> found;
  news_.wait_for(lock, std::chrono::duration<double>(std::max(0.0, timeout_s)), [&] {
    found = Find(query);
    return found.has_value();
  });
  if (!found) return found;
  const std::string id = CalibrationId(found->front()->calibration);
  for (const Pointer& view : *found) {
    const std::string other = CalibrationId(view->calibration);
    if (other == id) continue;
    return Fail("views {} and {} of scan '{}' were decoded with the calibrations {} and {}",
                found->front()->view_id, view->view_id, view->scan_id, id, other);
  }
  return found;
}

Result<std::vector<CodedViews::Pointer>> CodedViews::Find(const CodedViewsQuery& query) const {
  if (views_.empty()) return Fail("no view with codes has come yet");
  const std::string& scan_id = query.scan_id.empty() ? views_.back()->scan_id : query.scan_id;
  std::vector<Pointer> found;
  for (const Pointer& view : views_) {
    const bool asked = query.view_ids.empty() ||
                       std::find(query.view_ids.begin(), query.view_ids.end(), view->view_id) !=
                           query.view_ids.end();
    if (view->scan_id == scan_id && asked) found.push_back(view);
  }
  for (const int id : query.view_ids) {
    const bool there = std::any_of(found.begin(), found.end(),
                                   [id](const Pointer& view) { return view->view_id == id; });
    if (!there) {
      return Fail("no codes of view {} of scan '{}' among the {} views kept", id, scan_id,
                  views_.size());
    }
  }
  if (found.empty()) {
    return Fail("no codes of scan '{}' among the {} views kept", scan_id, views_.size());
  }
  std::sort(found.begin(), found.end(),
            [](const Pointer& a, const Pointer& b) { return a->view_id < b->view_id; });
  return found;
}

}  // namespace fringe_fusion::nodes
