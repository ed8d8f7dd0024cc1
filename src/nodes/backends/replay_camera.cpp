#include "nodes/backends/replay_camera.hpp"

#include <chrono>
#include <utility>

namespace fringe_fusion::nodes {

ReplayCamera::ReplayCamera(ReplayCameraConfig config) : config_(std::move(config)) {}

std::string ReplayCamera::Id() const {
  return fmt::format("replay of '{}' {}", config_.scan, serial_);
}

Status ReplayCamera::Configure(double exposure_s, double gain) {
  if (!(exposure_s > 0.0)) return Fail("{}: exposure {} s must be positive", Id(), exposure_s);
  if (!(gain >= 0.0)) return Fail("{}: gain {} must not be negative", Id(), gain);
  return {};
}

void ReplayCamera::Announce(int view_id, int frame_index) {
  view_id_ = view_id;
  frame_index_ = frame_index;
}

Status ReplayCamera::Load() {
  if (stack_ && stack_->view_id == view_id_) return {};
  const Result<ScanFolder> scan = OpenScan(config_.scan);
  if (!scan) return Fail("{}: {}", Id(), scan.error().message);
  Result<ImageStack> stack = ReadStack(*scan, view_id_);
  if (!stack) return Fail("{}: {}", Id(), stack.error().message);
  stack_ = std::move(*stack);
  serial_ = scan->calibration.camera_serial;
  return {};
}

Result<CapturedFrame> ReplayCamera::Capture(double /*timeout_s*/) {
  if (Status status = Load(); !status) return tl::unexpected<Error>(status.error());
  const auto index = static_cast<std::size_t>(frame_index_);
  if (frame_index_ < 0 || index >= stack_->frames.size()) {
    return Fail("{}: frame {} of view {} must be below {}", Id(), frame_index_, view_id_,
                stack_->frames.size());
  }
  CapturedFrame frame = stack_->frames[index];
  if (!config_.stamps || frame.stamp_ns == 0) {
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    frame.stamp_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
  }
  return frame;
}

}  // namespace fringe_fusion::nodes
