#include "nodes/backends/aravis_connection.hpp"

#include <cmath>
#include <cstring>
#include <utility>

namespace fringe_fusion::nodes {
namespace {

/// Receives the errors of Aravis' C functions.
class GlibError {
 public:
  GlibError() = default;
  GlibError(const GlibError&) = delete;
  GlibError& operator=(const GlibError&) = delete;
  ~GlibError() { g_clear_error(&error_); }

  GError** Out() {
    g_clear_error(&error_);
    return &error_;
  }
  [[nodiscard]] bool failed() const { return error_ != nullptr; }
  [[nodiscard]] std::string words() const {
    return error_ != nullptr ? error_->message : "no reason given";
  }
  /// Success, or the error with what was tried.
  [[nodiscard]] Status Check(const std::string& id, const char* step) const {
    if (!failed()) return {};
    return Fail("{}: cannot {}: {}", id, step, words());
  }

 private:
  GError* error_ = nullptr;
};

std::int64_t HostNowNs() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
}

const char* StatusWords(ArvBufferStatus status) {
  switch (status) {
    case ARV_BUFFER_STATUS_TIMEOUT:
      return "packets came too late";
    case ARV_BUFFER_STATUS_MISSING_PACKETS:
      return "packets are missing: raise packet_delay_us or check cable, switch and packet size";
    case ARV_BUFFER_STATUS_WRONG_PACKET_ID:
      return "a packet has a wrong number";
    case ARV_BUFFER_STATUS_SIZE_MISMATCH:
      return "the frame has another size than announced";
    case ARV_BUFFER_STATUS_ABORTED:
      return "the stream was aborted";
    default:
      return "the frame is not a picture";
  }
}

std::string Text(const char* text) { return text != nullptr ? text : ""; }

/// Aravis' id of the device with this serial number; "" if there is none.
std::string DeviceWithSerial(const std::string& serial) {
  arv_update_device_list();
  for (unsigned int i = 0; i < arv_get_n_devices(); ++i) {
    if (Text(arv_get_device_serial_nbr(i)) == serial) return Text(arv_get_device_id(i));
  }
  return "";
}

/// The devices of the last search.
std::string DevicesFound() {
  std::string list;
  for (unsigned int i = 0; i < arv_get_n_devices(); ++i) {
    list += fmt::format("{}{} at {}", i > 0 ? ", " : "", Text(arv_get_device_id(i)),
                        Text(arv_get_device_address(i)));
  }
  return list.empty() ? "none" : list;
}

}  // namespace

Result<std::unique_ptr<AravisCamera::Connection>> AravisCamera::Connection::Open(
    const AravisCameraConfig& config, int width, int height) {
  auto connection = std::make_unique<Connection>();
  GlibError error;
  const char* name = config.device.empty() ? nullptr : config.device.c_str();
  connection->camera_.reset(arv_camera_new(name, error.Out()));
  if (!connection->camera_ && name != nullptr) {
    // Aravis itself knows addresses, user-defined names and VENDOR-MODEL-SERIAL.
    const std::string id = DeviceWithSerial(config.device);
    if (!id.empty()) connection->camera_.reset(arv_camera_new(id.c_str(), error.Out()));
  }
  if (!connection->camera_) {
    return Fail(
        "GenICam camera '{}' was not found: {}: check power, cable and address; "
        "found are: {}",
        config.device, error.words(), DevicesFound());
  }
  ArvCamera* camera = connection->camera_.get();
  const char* model = arv_camera_get_model_name(camera, nullptr);
  const char* serial = arv_camera_get_device_serial_number(camera, nullptr);
  connection->id_ = fmt::format("camera {} {}", model != nullptr ? model : "(no model)",
                                serial != nullptr ? serial : "(no serial)");
  Status status = connection->SetUpImage(config, width, height);
  if (status) status = connection->SetUpTransport(config);
  if (status) status = connection->SetUpTrigger();
  if (status) status = connection->StartStream();
  if (!status) return tl::unexpected<Error>(status.error());
  return connection;
}

Status AravisCamera::Connection::SetUpImage(const AravisCameraConfig& config, int width,
                                            int height) {
  ArvCamera* camera = camera_.get();
  GlibError error;
  // A former client may have left the device running or waiting for another trigger.
  arv_camera_stop_acquisition(camera, error.Out());
  if (Status status = error.Check(id_, "stop the acquisition"); !status) return status;
  arv_camera_clear_triggers(camera, error.Out());
  if (Status status = error.Check(id_, "clear the triggers"); !status) return status;
  arv_camera_set_pixel_format_from_string(camera, config.pixel_format.c_str(), error.Out());
  if (Status status = error.Check(id_, "set the pixel format"); !status) return status;
  pixel_format_ = arv_camera_get_pixel_format(camera, error.Out());
  if (Status status = error.Check(id_, "read the pixel format"); !status) return status;
  bit_depth_ = std::stoi(config.pixel_format.substr(std::strlen("Mono")));
  arv_camera_set_region(camera, config.offset_x_px, config.offset_y_px, width, height, error.Out());
  if (Status status = error.Check(id_, "set the region"); !status) return status;
  gint x = 0;
  gint y = 0;
  gint device_width = 0;
  gint device_height = 0;
  arv_camera_get_region(camera, &x, &y, &device_width, &device_height, error.Out());
  if (Status status = error.Check(id_, "read the region"); !status) return status;
  if (device_width != width || device_height != height) {
    return Fail("{}: the device made its region {} x {} px, must be {} x {} as calibrated", id_,
                device_width, device_height, width, height);
  }
  return {};
}

Status AravisCamera::Connection::SetUpTransport(const AravisCameraConfig& config) {
  ArvCamera* camera = camera_.get();
  if (arv_camera_is_gv_device(camera) == FALSE) return {};
  GlibError error;
  if (config.packet_size_bytes > 0) {
    arv_camera_gv_set_packet_size(camera, config.packet_size_bytes, error.Out());
    if (Status status = error.Check(id_, "set the packet size"); !status) return status;
  }
  if (config.packet_delay_us > 0.0) {
    arv_camera_gv_set_packet_delay(camera, std::llround(1e3 * config.packet_delay_us), error.Out());
    if (Status status = error.Check(id_, "set the packet delay"); !status) return status;
  }
  return {};
}

Status AravisCamera::Connection::SetUpTrigger() {
  GlibError error;
  arv_camera_set_acquisition_mode(camera_.get(), ARV_ACQUISITION_MODE_CONTINUOUS, error.Out());
  if (Status status = error.Check(id_, "set continuous acquisition"); !status) return status;
  arv_camera_set_trigger(camera_.get(), "Software", error.Out());
  return error.Check(id_, "set the software trigger");
}

Status AravisCamera::Connection::StartStream() {
  GlibError error;
  const guint payload_bytes = arv_camera_get_payload(camera_.get(), error.Out());
  if (Status status = error.Check(id_, "read the payload size"); !status) return status;
  stream_.reset(arv_camera_create_stream(camera_.get(), nullptr, nullptr, error.Out()));
  if (!stream_) return Fail("{}: cannot open a stream: {}", id_, error.words());
  constexpr int kNumBuffers = 4;
  for (int i = 0; i < kNumBuffers; ++i) {
    arv_stream_push_buffer(stream_.get(), arv_buffer_new(payload_bytes, nullptr));
  }
  arv_camera_start_acquisition(camera_.get(), error.Out());
  return error.Check(id_, "start the acquisition");
}

Status AravisCamera::Connection::Set(double exposure_s, double gain) {
  if (Status status = SetExposure(exposure_s); !status) return status;
  return SetGain(gain);
}

Status AravisCamera::Connection::SetExposure(double exposure_s) {
  GlibError error;
  double low_us = 0.0;
  double high_us = 0.0;
  arv_camera_get_exposure_time_bounds(camera_.get(), &low_us, &high_us, error.Out());
  if (Status status = error.Check(id_, "read the exposure bounds"); !status) return status;
  if (!(1e6 * exposure_s >= low_us && 1e6 * exposure_s <= high_us)) {
    return Fail("{}: exposure {} s is outside the device's [{}, {}]", id_, exposure_s,
                1e-6 * low_us, 1e-6 * high_us);
  }
  if (arv_camera_is_exposure_auto_available(camera_.get(), nullptr) != FALSE) {
    arv_camera_set_exposure_time_auto(camera_.get(), ARV_AUTO_OFF, error.Out());
    if (Status status = error.Check(id_, "switch auto exposure off"); !status) return status;
  }
  arv_camera_set_exposure_time(camera_.get(), 1e6 * exposure_s, error.Out());
  if (Status status = error.Check(id_, "set the exposure"); !status) return status;
  exposure_s_ = 1e-6 * arv_camera_get_exposure_time(camera_.get(), error.Out());
  return error.Check(id_, "read the exposure");
}

Status AravisCamera::Connection::SetGain(double gain) {
  gain_ = 1.0;
  if (arv_camera_is_gain_available(camera_.get(), nullptr) == FALSE) return {};
  GlibError error;
  double low = 0.0;
  double high = 0.0;
  arv_camera_get_gain_bounds(camera_.get(), &low, &high, error.Out());
  if (Status status = error.Check(id_, "read the gain bounds"); !status) return status;
  if (!(gain >= low && gain <= high)) {
    return Fail("{}: gain {} is outside the device's [{}, {}]", id_, gain, low, high);
  }
  if (arv_camera_is_gain_auto_available(camera_.get(), nullptr) != FALSE) {
    arv_camera_set_gain_auto(camera_.get(), ARV_AUTO_OFF, error.Out());
    if (Status status = error.Check(id_, "switch auto gain off"); !status) return status;
  }
  arv_camera_set_gain(camera_.get(), gain, error.Out());
  if (Status status = error.Check(id_, "set the gain"); !status) return status;
  gain_ = arv_camera_get_gain(camera_.get(), error.Out());
  return error.Check(id_, "read the gain");
}

void AravisCamera::Connection::Drain() {
  while (ArvBuffer* buffer = arv_stream_try_pop_buffer(stream_.get())) {
    arv_stream_push_buffer(stream_.get(), buffer);
  }
}

AravisCamera::Connection::Shot AravisCamera::Connection::Trigger(double exposure_s,
                                                                 Clock::time_point deadline) {
  Drain();
  GlibError error;
  const std::int64_t trigger_ns = HostNowNs();
  arv_camera_software_trigger(camera_.get(), error.Out());
  if (error.failed()) {
    return {Outcome::kDeviceLost, "the software trigger failed: " + error.words(), {}};
  }
  while (Clock::now() < deadline) {
    const auto left =
        std::chrono::duration_cast<std::chrono::microseconds>(deadline - Clock::now());
    ArvBuffer* buffer = arv_stream_timeout_pop_buffer(
        stream_.get(), static_cast<guint64>(std::max<std::int64_t>(left.count(), 0)));
    if (buffer == nullptr) break;
    Shot shot = Convert(buffer, trigger_ns, exposure_s);
    arv_stream_push_buffer(stream_.get(), buffer);
    if (shot.outcome != Outcome::kNoFrame) return shot;
  }
  return {Outcome::kNoFrame, "nothing came after the last trigger", {}};
}

AravisCamera::Connection::Shot AravisCamera::Connection::Convert(ArvBuffer* buffer,
                                                                 std::int64_t trigger_ns,
                                                                 double exposure_s) {
  // Only a complete buffer has a size and pixels to ask for.
  const ArvBufferStatus status = arv_buffer_get_status(buffer);
  if (status != ARV_BUFFER_STATUS_SUCCESS) return {Outcome::kIncomplete, StatusWords(status), {}};
  const std::optional<std::int64_t> start_ns = HostTime(buffer, trigger_ns, exposure_s);
  if (!start_ns) return {Outcome::kNoFrame, "", {}};
  Result<FramePixels> pixels = CopyPixels(buffer);
  if (!pixels) return {Outcome::kIncomplete, pixels.error().message, {}};
  Shot shot{Outcome::kFrame, "", {}};
  shot.frame.pixels = std::move(*pixels);
  shot.frame.bit_depth = bit_depth_;
  shot.frame.exposure_s = exposure_s_;
  shot.frame.gain = gain_;
  shot.frame.stamp_ns = *start_ns + std::llround(0.5e9 * exposure_s_);
  return shot;
}

std::optional<std::int64_t> AravisCamera::Connection::HostTime(ArvBuffer* buffer,
                                                               std::int64_t trigger_ns,
                                                               double exposure_s) {
  const auto exposure_ns = static_cast<std::int64_t>(1e9 * exposure_s);
  const std::int64_t complete_ns = HostNowNs();
  const auto device_ns = static_cast<std::int64_t>(arv_buffer_get_timestamp(buffer));
  // A device without a clock: the trigger is the best guess of the exposure's begin.
  if (device_ns == 0) return trigger_ns;
  const std::optional<ClockMap::HostTime> expected = clock_map_.Map(device_ns);
  if (expected && expected->host_ns + expected->uncertainty_ns < trigger_ns) return std::nullopt;
  const auto first_packet_ns = static_cast<std::int64_t>(arv_buffer_get_system_timestamp(buffer));
  const std::int64_t not_after_ns = std::min(first_packet_ns, complete_ns - exposure_ns);
  return clock_map_.Add(device_ns, trigger_ns, not_after_ns).host_ns;
}

Result<FramePixels> AravisCamera::Connection::CopyPixels(ArvBuffer* buffer) const {
  const int width = arv_buffer_get_image_width(buffer);
  const int height = arv_buffer_get_image_height(buffer);
  const ArvPixelFormat format = arv_buffer_get_image_pixel_format(buffer);
  if (format != pixel_format_) {
    return Fail("frame of pixel format 0x{:08x}, must be 0x{:08x}", format, pixel_format_);
  }
  std::size_t size_bytes = 0;
  const void* data = arv_buffer_get_data(buffer, &size_bytes);
  const auto copy = [&](auto pixel) -> Result<FramePixels> {
    Image<decltype(pixel)> image(width, height);
    const std::size_t needed_bytes = image.size() * sizeof(pixel);
    if (size_bytes < needed_bytes) {
      return Fail("frame of {} bytes, must have {}", size_bytes, needed_bytes);
    }
    std::memcpy(image.data(), data, needed_bytes);
    return FramePixels(std::move(image));
  };
  return bit_depth_ == 8 ? copy(std::uint8_t{}) : copy(std::uint16_t{});
}

}  // namespace fringe_fusion::nodes
