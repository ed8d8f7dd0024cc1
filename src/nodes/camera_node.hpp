#pragma once

#include <camera_info_manager/camera_info_manager.h>
#include <diagnostic_updater/diagnostic_updater.h>
#include <dynamic_reconfigure/server.h>
#include <fringe_fusion/CameraConfig.h>
#include <fringe_fusion/Capture.h>
#include <image_transport/image_transport.h>
#include <ros/node_handle.h>

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/capture/devices.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::nodes {

struct CameraNodeConfig {
  std::string backend = "sim";  ///< sim, replay or aravis
  std::string camera_name = "scanner_camera";
  std::string frame_id = "camera_optical_frame";
  std::string calibration_file;  ///< path of cell.yaml
  std::string camera_info_url;   ///< empty: camera_info is that of cell.yaml
  double exposure_s = 0.02;
  double gain = 1.0;
  double timeout_s = 5.0;  ///< of one picture, retries included

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("backend", backend);
    field("camera_name", camera_name);
    field("frame_id", frame_id);
    field("calibration_file", calibration_file);
    field("camera_info_url", camera_info_url);
    field("exposure_s", exposure_s, 1e-5, 10.0);
    field("gain", gain, 0.0, 1000.0);
    field("timeout_s", timeout_s, 0.01, 600.0);
  }
};

/// Drives a camera: service `~capture`, topics `image_raw` and `camera_info`, `set_camera_info`,
/// exposure and gain by dynamic_reconfigure, `~reload_calibration`. A device that is absent makes
/// captures fail in words; it is looked for at the start and again until it is there, and at every
/// capture.
class CameraNode {
 public:
  /// @return error naming a parameter or cell.yaml.
  [[nodiscard]] static Result<std::unique_ptr<CameraNode>> Create(
      const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);

 private:
  struct Settings {
    double exposure_s;
    double gain;
  };

  CameraNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh, CameraNodeConfig config,
             CellCalibration calibration, std::unique_ptr<Camera> camera);

  /// Looks for the device until it is found once, so that its absence is known before a capture.
  void LookForDevice();
  bool OnCapture(Capture::Request& request, Capture::Response& response);
  [[nodiscard]] Result<CapturedFrame> CaptureFrame(const Capture::Request& request);
  /// The calibration belongs to one camera and one image size.
  [[nodiscard]] Status CheckDevice(const CapturedFrame& frame) const;
  void Publish(const sensor_msgs::Image& image);
  void OnSettings(const CameraConfig& settings);
  /// Takes calibration_file, and the file of camera_info, again.
  [[nodiscard]] Status ReloadCalibration();
  void Diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  CameraNodeConfig config_;

  std::mutex camera_mutex_;  // One exposure at a time; guards the calibration.
  CellCalibration calibration_;
  std::unique_ptr<Camera> camera_;

  std::mutex state_mutex_;  // Guards settings and figures.
  Settings settings_;
  std::string last_error_;
  std::uint64_t num_captured_ = 0;
  std::uint64_t num_failed_ = 0;
  double last_duration_s_ = 0.0;

  image_transport::ImageTransport transport_;
  image_transport::CameraPublisher publisher_;
  camera_info_manager::CameraInfoManager camera_info_;
  diagnostic_updater::Updater diagnostics_;
  ros::Timer diagnostics_timer_;
  ros::Timer device_timer_;
  ros::ServiceServer capture_;
  ros::ServiceServer reload_;
  std::unique_ptr<dynamic_reconfigure::Server<CameraConfig>> settings_server_;
};

}  // namespace fringe_fusion::nodes
