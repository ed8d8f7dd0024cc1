#pragma once

#include <actionlib/client/simple_action_client.h>
#include <fringe_fusion/MoveToViewAction.h>
#include <fringe_fusion/ScanObjectAction.h>
#include <fringe_fusion/ScanViewAction.h>
#include <sys/types.h>

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "fringe_fusion/surface/mesh.hpp"

// What the tests of the whole graph share. All waits have a deadline in wall time.
namespace fringe_fusion::test {

using MoveClient = actionlib::SimpleActionClient<MoveToViewAction>;
using ScanViewClient = actionlib::SimpleActionClient<ScanViewAction>;
using ScanObjectClient = actionlib::SimpleActionClient<ScanObjectAction>;

/// Polls until `condition` holds. @return false after timeout_s.
[[nodiscard]] bool WaitFor(const std::function<bool()>& condition, double timeout_s);

/// Waits for a goal. @return its state, or "TIMEOUT".
template <typename Client>
[[nodiscard]] std::string WaitForEnd(Client& client, double timeout_s) {
  const bool done = WaitFor([&client] { return client.getState().isDone(); }, timeout_s);
  return done ? client.getState().toString() : "TIMEOUT";
}

/// Waits until devices, simulation and processing answer: the simulated part takes seconds to load.
[[nodiscard]] bool WaitForCell(double timeout_s);

/// Process id of a node, asked of the node itself; 0 if it does not answer.
[[nodiscard]] pid_t NodePid(const std::string& node);

/// Names of the nodes that subscribe to each topic.
[[nodiscard]] std::map<std::string, std::vector<std::string>> Subscribers();

/// A child process, interrupted and reaped at the end of its life.
class Process {
 public:
  explicit Process(const std::vector<std::string>& arguments);
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;
  ~Process();

  /// @return true when it has ended by itself, with status 0, within timeout_s.
  [[nodiscard]] bool EndsWell(double timeout_s);
  /// Sends SIGINT and waits. @return true when it has ended within timeout_s.
  bool Interrupt(double timeout_s);

 private:
  bool Reap(double timeout_s);
  pid_t pid_ = -1;
  int status_ = -1;
};

/// A view scanned and its cloud against the simulation's truth.
struct ViewComparison {
  std::string failure;  ///< words, empty if there is a comparison
  std::size_t num_points = 0;
  double median_m = 0.0;       ///< distance to the true point of the same pixel ...
  double p95_m = 0.0;          ///< ... which mixed pixels at depth steps dominate beyond 95 %
  std::string calibration_id;  ///< that the view says it was made with
  double complete_ratio = 0;   ///< share of the lit pixels of the part that carry a point
};
/// Scans one view at a turntable angle through scan_view.
[[nodiscard]] ViewComparison ScanAndCompareView(double angle_rad, double timeout_s);

}  // namespace fringe_fusion::test
