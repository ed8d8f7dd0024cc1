#pragma once

#include <arv.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "fringe_fusion/capture/clock_map.hpp"
#include "fringe_fusion/capture/image_stack.hpp"
#include "nodes/backends/aravis_camera.hpp"

namespace fringe_fusion::nodes {

/// An open device with a running stream.
class AravisCamera::Connection {
 public:
  using Clock = std::chrono::steady_clock;

  /// What one trigger brought.
  enum class Outcome { kFrame, kIncomplete, kNoFrame, kDeviceLost };
  struct Shot {
    Outcome outcome = Outcome::kNoFrame;
    std::string words;  // Of a failure.
    CapturedFrame frame;
  };

  /// @return error naming the device and the step that failed.
  [[nodiscard]] static Result<std::unique_ptr<Connection>> Open(const AravisCameraConfig& config,
                                                                int width, int height);

  [[nodiscard]] const std::string& id() const { return id_; }
  /// @return error when the device refuses a value, naming the range it takes.
  [[nodiscard]] Status Set(double exposure_s, double gain);
  /// Triggers once and waits for the frame that this trigger made.
  [[nodiscard]] Shot Trigger(double exposure_s, Clock::time_point deadline);

 private:
  struct Unref {
    void operator()(gpointer object) const { g_object_unref(object); }
  };
  /// Ends the acquisition before the stream goes away.
  struct StopAndUnref {
    void operator()(ArvCamera* camera) const {
      arv_camera_stop_acquisition(camera, nullptr);
      g_object_unref(camera);
    }
  };

  [[nodiscard]] Status SetUpImage(const AravisCameraConfig& config, int width, int height);
  [[nodiscard]] Status SetUpTransport(const AravisCameraConfig& config);
  [[nodiscard]] Status SetUpTrigger();
  [[nodiscard]] Status StartStream();
  [[nodiscard]] Status SetExposure(double exposure_s);
  [[nodiscard]] Status SetGain(double gain);
  void Drain();
  [[nodiscard]] Shot Convert(ArvBuffer* buffer, std::int64_t trigger_ns, double exposure_s);
  [[nodiscard]] Result<FramePixels> CopyPixels(ArvBuffer* buffer) const;
  /// Host time of the exposure's begin; nothing for a frame that began before the trigger.
  [[nodiscard]] std::optional<std::int64_t> HostTime(ArvBuffer* buffer, std::int64_t trigger_ns,
                                                     double exposure_s);

  std::unique_ptr<ArvCamera, StopAndUnref> camera_;
  std::unique_ptr<ArvStream, Unref> stream_;  // Goes before the camera.
  std::string id_;
  ArvPixelFormat pixel_format_ = ARV_PIXEL_FORMAT_MONO_8;
  int bit_depth_ = 8;
  double exposure_s_ = 0.0;  // As the device rounded it.
  double gain_ = 1.0;
  ClockMap clock_map_;
};

}  // namespace fringe_fusion::nodes
