#pragma once

#include <chrono>
#include <csignal>
#include <string>
#include <utility>
#include <vector>

#include "fringe_fusion/common/progress.hpp"

namespace fringe_fusion::cli {

/// Holds SIGINT and SIGTERM back while it lives, so that a command is never torn apart in the
/// middle of a write: the computation asks whether one is pending and then ends in good order.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

  /// Whether the user asked to stop. Works on every thread.
  [[nodiscard]] static bool Pending();

 private:
  sigset_t previous_{};
};

/// Shows how far a command is, on stderr: a bar where a person looks at it, else one line per step.
class Console {
 public:
  Console(std::string command, bool quiet);

  /// Begins a step that consists of `num_parts` equal parts, e.g. views.
  void Begin(const std::string& step, int num_parts);
  /// Progress sink of part `part` of the present step; cancels when the user interrupts.
  [[nodiscard]] Progress Part(int part);
  /// Ends the present step and notes its time.
  void End();

  /// Steps that ended, with their wall time [s].
  [[nodiscard]] const std::vector<std::pair<std::string, double>>& seconds() const {
    return seconds_;
  }

 private:
  void Draw(double fraction);

  std::string command_;
  bool quiet_ = false;
  bool terminal_ = false;
  std::string step_;
  int num_parts_ = 1;
  std::chrono::steady_clock::time_point begin_;
  std::chrono::steady_clock::time_point drawn_;
  std::vector<std::pair<std::string, double>> seconds_;
};

}  // namespace fringe_fusion::cli
