#pragma once

#include <functional>
#include <memory>

namespace fringe_fusion {

/// Limits the number of threads that ParallelFor uses while it lives (oneTBB global_control).
class ThreadLimit {
 public:
  /// @param num_threads at least 1; 0 means all cores.
  explicit ThreadLimit(int num_threads);
  ~ThreadLimit();
  ThreadLimit(const ThreadLimit&) = delete;
  ThreadLimit& operator=(const ThreadLimit&) = delete;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Calls body(begin, end) on the fixed chunks [0, grain), [grain, 2 grain), ... of [0, count).
/// The chunks do not depend on the number of threads, so per-chunk partial results that are
/// combined in chunk order are the same bytes on any machine. Exceptions of body propagate.
/// @param grain chunk length, at least 1; chunk number = begin / grain.
void ParallelFor(int count, int grain, const std::function<void(int begin, int end)>& body);

}  // namespace fringe_fusion
