#include "fringe_fusion/capture/clock_map.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fringe_fusion {

ClockMap::HostTime ClockMap::Add(std::int64_t device_ns, std::int64_t not_before_ns,
                                 std::int64_t not_after_ns) {
  // The host's clock may have been set back in between: the frame's own bounds then meet in a
  // point.
  not_after_ns = std::max(not_after_ns, not_before_ns);
  frames_.push_back({device_ns, not_before_ns - device_ns, not_after_ns - device_ns});
  if (frames_.size() > num_frames_) frames_.pop_front();
  std::optional<HostTime> mapped = Map(device_ns);
  if (!mapped) {
    frames_.erase(frames_.begin(), frames_.end() - 1);
    mapped = Map(device_ns);
  }
  return mapped.value();
}

std::optional<ClockMap::HostTime> ClockMap::Map(std::int64_t device_ns) const {
  if (frames_.empty()) return std::nullopt;
  std::int64_t low = std::numeric_limits<std::int64_t>::min();
  std::int64_t high = std::numeric_limits<std::int64_t>::max();
  for (const Frame& frame : frames_) {
    const double age_ns = std::abs(static_cast<double>(device_ns - frame.device_ns));
    const auto drift_ns = static_cast<std::int64_t>(std::ceil(age_ns * max_drift_ratio_));
    low = std::max(low, frame.offset_low_ns - drift_ns);
    high = std::min(high, frame.offset_high_ns + drift_ns);
  }
  if (low > high) return std::nullopt;
  return HostTime{device_ns + low + (high - low) / 2, (high - low) / 2};
}

}  // namespace fringe_fusion
