#include "nodes/backends/replay_camera.hpp"

#include <chrono>
#include <utility>

namespace fringe_fusion::nodes {

ReplayCamera::ReplayCamera(ReplayCameraConfig config) : config_(std::move(config)) {}

std::string ReplayCamera::Id() const {
  return fmt::format("replay of view {} in '{}' {}", config_.view_id, config_.scan, serial_);
}

Status ReplayCamera::Configure(double exposure_s, double gain) {
  if (!(exposure_s > 0.0)) return Fail("{}: exposure {} s must be positive", Id(), exposure_s);
  if (!(gain >= 0.0)) return Fail("{}: gain {} must not be negative", Id(), gain);
  return {};
}

Result<CapturedFrame> ReplayCamera::Capture(double /*timeout_s*/) {
  if (!stack_) {
    const Result<ScanFolder> scan = OpenScan(config_.scan);
    if (!scan) return Fail("{}: {}", Id(), scan.error().message);
    Result<ImageStack> stack = ReadStack(*scan, config_.view_id);
    if (!stack) return Fail("{}: {}", Id(), stack.error().message);
    stack_ = std::move(*stack);
    serial_ = scan->calibration.camera_serial;
  }
  CapturedFrame frame = stack_->frames[next_];
  next_ = (next_ + 1) % stack_->frames.size();
  if (!config_.stamps || frame.stamp_ns == 0) {
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    frame.stamp_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
  }
  return frame;
}

}  // namespace fringe_fusion::nodes
