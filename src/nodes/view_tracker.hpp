#pragma once

#include <fringe_fusion/StageState.h>
#include <fringe_fusion/ViewStatus.h>

#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace fringe_fusion::nodes {

/// Follows the views of one scan through phase, pose and fusion, by what those nodes say, and
/// notices when a node has lost views because it was restarted. Safe to use from several threads.
class ViewTracker {
 public:
  using Clock = std::chrono::steady_clock;

  /// What became of one view.
  struct Progress {
    int num_points = 0;   ///< integrated
    int num_dropped = 0;  ///< by the crop
    double phase_s = 0.0;
    double pose_s = 0.0;
    double fusion_s = 0.0;
  };

  void Begin(const std::string& scan_id);
  /// The frames of a view have gone out, or go out again.
  void Sent(int view_id);

  void OnStatus(const ViewStatus& status);
  void OnState(const StageState& state);

  /// Waits for news, at most until timeout.
  void WaitForNews(std::chrono::milliseconds timeout);

  /// Sent views that pose or fusion do not hold yet.
  [[nodiscard]] std::vector<int> InFlight() const;
  /// Views that a restarted node no longer holds; they must be sent again.
  [[nodiscard]] std::vector<int> Lost() const;
  /// Views in flight since before `since`.
  [[nodiscard]] std::vector<int> Overdue(Clock::time_point since) const;
  /// Words of a stage that refused a view, if any did.
  [[nodiscard]] std::optional<std::string> Refusal() const;
  [[nodiscard]] std::map<int, Progress> Views() const;

 private:
  struct Stage {
    std::set<int> held;
    std::set<int> lost;
  };
  [[nodiscard]] bool HeldByAll(int view_id) const;

  mutable std::mutex mutex_;
  std::condition_variable news_;
  std::string scan_id_;
  std::map<int, Clock::time_point> sent_;
  std::map<std::string, Stage> stages_;
  std::map<int, Progress> views_;
  std::optional<std::string> refusal_;
};

}  // namespace fringe_fusion::nodes
