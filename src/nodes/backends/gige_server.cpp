#include "nodes/backends/gige_server.hpp"

#include <arv.h>
#include <ros/console.h>

#include <cstring>
#include <utility>

namespace fringe_fusion::nodes {

struct GigeServer::Impl {
  Impl(GigeServerConfig config_in, Expose expose_in)
      : config(std::move(config_in)), expose(std::move(expose_in)) {}

  /// Aravis calls this in the camera's thread for every triggered frame.
  static void Fill(ArvBuffer* buffer, void* self, guint32 exposure_us, guint32 /*gain*/,
                   ArvPixelFormat format) {
    static_cast<Impl*>(self)->FillBuffer(buffer, exposure_us, format);
  }

  void FillBuffer(ArvBuffer* buffer, guint32 exposure_us, ArvPixelFormat format) {
    const Status filled = Copy(expose(1e-6 * exposure_us), format, buffer);
    // A camera that cannot make its picture must not send another one: all packets are lost.
    const double lost_ratio = filled ? config.lost_ratio : 1.0;
    g_object_set(camera, "gvsp-lost-ratio", lost_ratio, nullptr);
    if (!filled) {
      ROS_ERROR_THROTTLE(5.0, "GigE Vision camera %s sends no frame: %s", config.serial.c_str(),
                         filled.error().message.c_str());
    }
  }

  static Status Copy(const Result<CapturedFrame>& frame, ArvPixelFormat format, ArvBuffer* buffer) {
    if (!frame) return tl::unexpected<Error>(frame.error());
    const auto* pixels = std::get_if<Image<std::uint8_t>>(&frame->pixels);
    if (pixels == nullptr || format != ARV_PIXEL_FORMAT_MONO_8) {
      return Fail("{} bit picture and pixel format 0x{:08x}, both must be Mono8", frame->bit_depth,
                  format);
    }
    const int width = arv_buffer_get_image_width(buffer);
    const int height = arv_buffer_get_image_height(buffer);
    if (width != pixels->width() || height != pixels->height()) {
      return Fail("region of {} x {} px, must be that of the picture, {} x {}", width, height,
                  pixels->width(), pixels->height());
    }
    // Aravis hands out a const pointer to the buffer that this callback is there to fill. It holds
    // the region; the size that Aravis tells is of what was received, here still nothing.
    std::size_t received_bytes = 0;
    void* data = const_cast<void*>(arv_buffer_get_data(buffer, &received_bytes));
    std::memcpy(data, pixels->data(), pixels->size());
    return {};
  }

  GigeServerConfig config;
  Expose expose;
  ArvGvFakeCamera* camera = nullptr;
};

Result<std::unique_ptr<GigeServer>> GigeServer::Start(const GigeServerConfig& config,
                                                      Expose expose) {
  if (config.serial.empty()) return Fail("GigE Vision camera: serial is empty");
  auto impl = std::make_unique<Impl>(config, std::move(expose));
  impl->camera = arv_gv_fake_camera_new(config.interface.c_str(), config.serial.c_str());
  std::unique_ptr<GigeServer> server(new GigeServer(std::move(impl)));
  ArvGvFakeCamera* camera = server->impl_->camera;
  if (camera == nullptr || arv_gv_fake_camera_is_running(camera) == FALSE) {
    return Fail(
        "GigE Vision camera {} cannot be served on interface '{}': no such interface, or "
        "its port 3956 is taken",
        config.serial, config.interface);
  }
  ArvFakeCamera* fake = arv_gv_fake_camera_get_fake_camera(camera);
  arv_fake_camera_set_fill_pattern(fake, &Impl::Fill, server->impl_.get());
  // Aravis looks for a trigger this often only, so it bounds the delay of a frame.
  constexpr double kTriggerPollHz = 250.0;
  arv_fake_camera_set_trigger_frequency(fake, kTriggerPollHz);
  return server;
}

GigeServer::GigeServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

GigeServer::~GigeServer() {
  if (impl_->camera != nullptr) g_object_unref(impl_->camera);  // Ends the thread that fills.
}

}  // namespace fringe_fusion::nodes
