#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

namespace fringe_fusion {

/// Maps the clock of a device to the clock of the host from what a software trigger teaches: every
/// frame began after its trigger was sent and before its data arrived. The offset of the clocks
/// lies in the intersection of these intervals over the last frames, each widened by what the
/// clocks may have drifted apart since. Unlike the arrival time alone, this does not carry the
/// jitter of network and scheduler into the stamps.
class ClockMap {
 public:
  /// Host time of a device time, and how wrong it may be.
  struct HostTime {
    std::int64_t host_ns = 0;
    std::int64_t uncertainty_ns = 0;  ///< half the width of the intersection
  };

  /// @param max_drift_ratio bound on the clocks' relative rate error, e.g. 1e-4.
  /// @param num_frames how many frames back are used.
  explicit ClockMap(double max_drift_ratio = 1e-4, std::size_t num_frames = 64)
      : max_drift_ratio_(max_drift_ratio), num_frames_(num_frames) {}

  /// Adds a frame whose device time `device_ns` fell between two host times.
  /// Contradicting frames (a clock was set) make it start anew from this frame.
  /// @return host time of device_ns, always within [not_before_ns, not_after_ns].
  HostTime Add(std::int64_t device_ns, std::int64_t not_before_ns, std::int64_t not_after_ns);

  /// Host time of a device time by the frames so far. @return nothing before the first frame.
  [[nodiscard]] std::optional<HostTime> Map(std::int64_t device_ns) const;

  /// Forgets all frames, e.g. after the device was connected again.
  void Reset() { frames_.clear(); }

 private:
  struct Frame {
    std::int64_t device_ns = 0;
    std::int64_t offset_low_ns = 0;   // host - device
    std::int64_t offset_high_ns = 0;  // host - device
  };

  double max_drift_ratio_;
  std::size_t num_frames_;
  std::deque<Frame> frames_;
};

}  // namespace fringe_fusion
