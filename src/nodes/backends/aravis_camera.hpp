#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "fringe_fusion/capture/devices.hpp"

namespace fringe_fusion::nodes {

struct AravisCameraConfig {
  std::string device;                  ///< address, serial or name; empty: the first one found
  std::string pixel_format = "Mono8";  ///< Mono8, Mono10, Mono12 or Mono16
  int offset_x_px = 0;  ///< of the region on the sensor; its size is the calibration's
  int offset_y_px = 0;
  int packet_size_bytes = 0;     ///< GigE Vision; 0: as the device has it
  double packet_delay_us = 0.0;  ///< GigE Vision, between packets; 0: none
  double frame_timeout_s = 2.0;  ///< from the end of the exposure until the frame is here
  int retries = 3;               ///< of a frame that came incomplete or not at all

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("device", device);
    field("pixel_format", pixel_format);
    field("offset_x_px", offset_x_px, 0, 65535);
    field("offset_y_px", offset_y_px, 0, 65535);
    field("packet_size_bytes", packet_size_bytes, 0, 16384);
    field("packet_delay_us", packet_delay_us, 0.0, 1e6);
    field("frame_timeout_s", frame_timeout_s, 0.01, 600.0);
    field("retries", retries, 0, 100);
  }
};

/// Checks what bounds cannot say. @return error naming the pixel format.
[[nodiscard]] Status Validate(const AravisCameraConfig& config, const std::string& owner);

/// A GigE Vision or USB3 Vision camera, software-triggered, by Aravis. Connects when first asked
/// and again after the device was lost. Stamps are true: the device's clock is mapped to the
/// host's, see ClockMap. Frame ids are not relied on: they need not start at zero nor be without
/// gaps, and a frame that was exposed before its trigger is told by its stamp.
class AravisCamera : public Camera {
 public:
  /// @param width and height of the region [px].
  AravisCamera(AravisCameraConfig config, int width, int height);
  ~AravisCamera() override;

  [[nodiscard]] std::string Id() const override;
  [[nodiscard]] Status Connect() override;
  [[nodiscard]] Status Configure(double exposure_s, double gain) override;
  [[nodiscard]] Result<CapturedFrame> Capture(double timeout_s) override;

 private:
  class Connection;

  [[nodiscard]] Status ApplySettings();
  /// Lets go of the connection without waiting for it to close.
  void Drop();

  AravisCameraConfig config_;
  int width_;
  int height_;
  double exposure_s_ = 0.0;
  double gain_ = 0.0;
  bool settings_changed_ = true;
  std::unique_ptr<Connection> connection_;
  std::vector<std::future<void>> closing_;
};

}  // namespace fringe_fusion::nodes
