#include "nodes/backends/aravis_camera.hpp"

#include <algorithm>
#include <utility>

#include "nodes/backends/aravis_connection.hpp"

namespace fringe_fusion::nodes {

Status Validate(const AravisCameraConfig& config, const std::string& owner) {
  for (const char* format : {"Mono8", "Mono10", "Mono12", "Mono16"}) {
    if (config.pixel_format == format) return {};
  }
  return Fail("{}: pixel_format '{}' must be Mono8, Mono10, Mono12 or Mono16", owner,
              config.pixel_format);
}

AravisCamera::AravisCamera(AravisCameraConfig config, int width, int height)
    : config_(std::move(config)), width_(width), height_(height) {}

AravisCamera::~AravisCamera() = default;

std::string AravisCamera::Id() const {
  if (connection_) return connection_->id();
  return config_.device.empty() ? "GenICam camera" : "GenICam camera '" + config_.device + "'";
}

Status AravisCamera::Configure(double exposure_s, double gain) {
  if (!(exposure_s > 0.0)) return Fail("{}: exposure {} s must be positive", Id(), exposure_s);
  if (!(gain >= 0.0)) return Fail("{}: gain {} must not be negative", Id(), gain);
  settings_changed_ = settings_changed_ || exposure_s != exposure_s_ || gain != gain_;
  exposure_s_ = exposure_s;
  gain_ = gain;
  return {};
}

Status AravisCamera::Connect() {
  if (connection_) return {};
  auto connection = Connection::Open(config_, width_, height_);
  if (!connection) return tl::unexpected<Error>(connection.error());
  connection_ = std::move(*connection);
  settings_changed_ = true;
  return {};
}

Status AravisCamera::ApplySettings() {
  if (!settings_changed_) return {};
  if (Status status = connection_->Set(exposure_s_, gain_); !status) {
    Drop();
    return status;
  }
  settings_changed_ = false;
  return {};
}

void AravisCamera::Drop() {
  const auto is_closed = [](const std::future<void>& closing) {
    return closing.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
  };
  closing_.erase(std::remove_if(closing_.begin(), closing_.end(), is_closed), closing_.end());
  // Each register write to a device that is gone runs into its own time limit.
  closing_.push_back(std::async(
      std::launch::async, [connection = std::move(connection_)]() mutable { connection.reset(); }));
}

Result<CapturedFrame> AravisCamera::Capture(double timeout_s) {
  using Clock = Connection::Clock;
  const auto seconds = [](double value_s) {
    return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(value_s));
  };
  const Clock::time_point deadline = Clock::now() + seconds(timeout_s);
  if (Status status = Connect(); !status) return tl::unexpected<Error>(status.error());
  if (Status status = ApplySettings(); !status) return tl::unexpected<Error>(status.error());

  std::string words;
  int num_incomplete = 0;
  int num_triggers = 0;
  while (num_triggers <= config_.retries && (num_triggers == 0 || Clock::now() < deadline)) {
    const Clock::time_point limit =
        std::min(deadline, Clock::now() + seconds(exposure_s_ + config_.frame_timeout_s));
    Connection::Shot shot = connection_->Trigger(exposure_s_, limit);
    ++num_triggers;
    if (shot.outcome == Connection::Outcome::kFrame) return std::move(shot.frame);
    words = shot.words;
    if (shot.outcome == Connection::Outcome::kIncomplete) ++num_incomplete;
    if (shot.outcome == Connection::Outcome::kDeviceLost) break;
  }
  const std::string id = Id();
  // A device that still sends something is kept; a silent one is looked for again next time.
  if (num_incomplete == 0) Drop();
  return Fail("{}: no complete frame after {} software triggers within {} s ({} incomplete): {}",
              id, num_triggers, timeout_s, num_incomplete, words);
}

}  // namespace fringe_fusion::nodes
