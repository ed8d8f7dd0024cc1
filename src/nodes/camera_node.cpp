#include "nodes/camera_node.hpp"

#include <utility>

#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/ros_io/configs.hpp"
#include "fringe_fusion/ros_io/frame_messages.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"
#include "nodes/backends/aravis_camera.hpp"
#include "nodes/backends/replay_camera.hpp"
#include "nodes/backends/sim_camera.hpp"
#include "nodes/calibration_reload.hpp"

namespace fringe_fusion::nodes {
namespace {

Result<std::unique_ptr<Camera>> MakeCamera(const std::string& backend, const CameraModel& model,
                                           const ros::NodeHandle& nh,
                                           const ros::NodeHandle& private_nh) {
  ros_io::DeclareConfig<SimCameraConfig>(ros::NodeHandle(private_nh, "sim"));
  ros_io::DeclareConfig<ReplayCameraConfig>(ros::NodeHandle(private_nh, "replay"));
  ros_io::DeclareConfig<AravisCameraConfig>(ros::NodeHandle(private_nh, "aravis"));
  const ros::NodeHandle backend_nh(private_nh, backend);
  if (backend == "sim") {
    const auto config = ros_io::LoadConfig<SimCameraConfig>(backend_nh);
    if (!config) return Forward(config);
    return std::make_unique<SimCamera>(nh, *config);
  }
  if (backend == "replay") {
    const auto config = ros_io::LoadConfig<ReplayCameraConfig>(backend_nh);
    if (!config) return Forward(config);
    return std::make_unique<ReplayCamera>(*config);
  }
  if (backend == "aravis") {
    const auto config = ros_io::LoadConfig<AravisCameraConfig>(backend_nh);
    if (!config) return Forward(config);
    if (Status status = Validate(*config, backend_nh.getNamespace()); !status) {
      return tl::unexpected<Error>(status.error());
    }
    return std::make_unique<AravisCamera>(*config, model.width, model.height);
  }
  return Fail("parameter {} is '{}', must be sim, replay or aravis",
              private_nh.resolveName("backend"), backend);
}

}  // namespace

Result<std::unique_ptr<CameraNode>> CameraNode::Create(const ros::NodeHandle& nh,
                                                       const ros::NodeHandle& private_nh) {
  const auto config = ros_io::LoadConfig<CameraNodeConfig>(private_nh);
  if (!config) return Forward(config);
  const Result<CellCalibration> calibration = ReadCellCalibration(config->calibration_file);
  if (!calibration) return Forward(calibration);
  auto camera = MakeCamera(config->backend, calibration->camera, nh, private_nh);
  if (!camera) return Forward(camera);
  return std::unique_ptr<CameraNode>(
      new CameraNode(nh, private_nh, *config, *calibration, std::move(*camera)));
}

CameraNode::CameraNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                       CameraNodeConfig config, CellCalibration calibration,
                       std::unique_ptr<Camera> camera)
    : config_(std::move(config)),
      calibration_(std::move(calibration)),
      camera_(std::move(camera)),
      settings_{config_.exposure_s, config_.gain},
      transport_(nh),
      publisher_(transport_.advertiseCamera("image_raw", 2, /*latch=*/true)),
      camera_info_(nh, config_.camera_name, config_.camera_info_url),
      diagnostics_(nh, private_nh, ros::this_node::getName()) {
  // Without a URL the manager would take whatever lies in the user's ROS home.
  if (config_.camera_info_url.empty()) {
    camera_info_.setCameraInfo(ros_io::ToMessage(calibration_.camera));
  }
  ros::NodeHandle handle = private_nh;
  diagnostics_.setHardwareID(camera_->Id());
  diagnostics_.add("camera", this, &CameraNode::Diagnose);
  diagnostics_timer_ =
      handle.createTimer(ros::Duration(0.5), [this](const auto&) { diagnostics_.update(); });
  settings_server_ = std::make_unique<dynamic_reconfigure::Server<CameraConfig>>(private_nh);
  settings_server_->setCallback(
      [this](const CameraConfig& settings, std::uint32_t /*level*/) { OnSettings(settings); });
  capture_ = handle.advertiseService("capture", &CameraNode::OnCapture, this);
  reload_ = AdvertiseReload(private_nh, [this] { return ReloadCalibration(); });
  device_timer_ = handle.createTimer(ros::Duration(1.0), [this](const auto&) { LookForDevice(); });
}

void CameraNode::LookForDevice() {
  const std::lock_guard<std::mutex> camera_lock(camera_mutex_);
  const Status status = camera_->Connect();
  const std::lock_guard<std::mutex> state_lock(state_mutex_);
  if (!status) {
    // A failed capture since then says more.
    if (num_failed_ == 0) last_error_ = status.error().message;
    ROS_WARN_THROTTLE(60.0, "%s; it is looked for again", status.error().message.c_str());
    return;
  }
  if (num_failed_ == 0) last_error_.clear();
  ROS_INFO("%s for %d x %d px", camera_->Id().c_str(), calibration_.camera.width,
           calibration_.camera.height);
  device_timer_.stop();
}

bool CameraNode::OnCapture(Capture::Request& request, Capture::Response& response) {
  const std::lock_guard<std::mutex> camera_lock(camera_mutex_);
  const ros::SteadyTime begin = ros::SteadyTime::now();
  const Result<CapturedFrame> frame = CaptureFrame(request);
  const std::lock_guard<std::mutex> state_lock(state_mutex_);
  last_duration_s_ = (ros::SteadyTime::now() - begin).toSec();
  if (!frame) {
    ++num_failed_;
    last_error_ = frame.error().message;
    response.message = last_error_;
    ROS_ERROR_THROTTLE(5.0, "capture failed: %s", last_error_.c_str());
    return true;
  }
  if (!last_error_.empty()) ROS_INFO("%s answers again", camera_->Id().c_str());
  last_error_.clear();
  ++num_captured_;
  response.success = 1;
  response.image = ros_io::ToMessage(*frame, config_.frame_id);
  response.exposure = frame->exposure_s;
  response.gain = frame->gain;
  response.bit_depth = static_cast<std::uint32_t>(frame->bit_depth);
  Publish(response.image);
  return true;
}

Result<CapturedFrame> CameraNode::CaptureFrame(const Capture::Request& request) {
  Settings settings{};
  {
    const std::lock_guard<std::mutex> lock(state_mutex_);
    settings = settings_;
  }
  CameraNodeConfig wanted = config_;  // The limits of the parameters are those of a request.
  if (request.exposure != 0.0) wanted.exposure_s = request.exposure;
  if (request.gain != 0.0) wanted.gain = request.gain;
  if (!request.timeout.isZero()) wanted.timeout_s = request.timeout.toSec();
  if (Status status = CheckBounds(wanted, "capture"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  if (request.exposure > 0.0) settings.exposure_s = request.exposure;
  if (request.gain > 0.0) settings.gain = request.gain;
  const double timeout_s = request.timeout.isZero() ? config_.timeout_s : request.timeout.toSec();
  if (Status status = camera_->Configure(settings.exposure_s, settings.gain); !status) {
    return tl::unexpected<Error>(status.error());
  }
  camera_->Announce(static_cast<int>(request.view_id), static_cast<int>(request.frame_index));
  Result<CapturedFrame> frame = camera_->Capture(timeout_s);
  if (!frame) return frame;
  if (Status status = CheckDevice(*frame); !status) return tl::unexpected<Error>(status.error());
  return frame;
}

Status CameraNode::CheckDevice(const CapturedFrame& frame) const {
  const CameraModel& model = calibration_.camera;
  if (Width(frame) != model.width || Height(frame) != model.height) {
    return Fail("{}: picture of {} x {} px, but {} was calibrated at {} x {} px", camera_->Id(),
                Width(frame), Height(frame), config_.calibration_file, model.width, model.height);
  }
  if (camera_->Id().find(calibration_.camera_serial) == std::string::npos) {
    return Fail("{}: {} was calibrated with the camera of serial '{}'", camera_->Id(),
                config_.calibration_file, calibration_.camera_serial);
  }
  return {};
}

void CameraNode::Publish(const sensor_msgs::Image& image) {
  sensor_msgs::CameraInfo camera_info = camera_info_.getCameraInfo();
  camera_info.header = image.header;
  publisher_.publish(image, camera_info);
}

Status CameraNode::ReloadCalibration() {
  const std::lock_guard<std::mutex> lock(camera_mutex_);
  auto calibration = RereadCalibration(config_.calibration_file, calibration_);
  if (!calibration) return Forward(calibration);
  if (config_.camera_info_url.empty()) {
    camera_info_.setCameraInfo(ros_io::ToMessage(calibration->camera));
  } else if (!camera_info_.loadCameraInfo(config_.camera_info_url)) {
    return Fail("camera_info cannot be read from {}", config_.camera_info_url);
  }
  calibration_ = std::move(*calibration);
  ROS_INFO("calibration %s is in force", CalibrationId(calibration_).c_str());
  return {};
}

void CameraNode::OnSettings(const CameraConfig& settings) {
  const std::lock_guard<std::mutex> lock(state_mutex_);
  settings_ = {settings.exposure_s, settings.gain};
}

void CameraNode::Diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(state_mutex_);
  if (last_error_.empty()) {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK,
                   num_captured_ > 0 ? "captures" : "not asked yet");
  } else {
    status.summary(diagnostic_msgs::DiagnosticStatus::ERROR, last_error_);
  }
  status.add("backend", config_.backend);
  status.add("captured", num_captured_);
  status.add("failed", num_failed_);
  status.add("last duration [s]", last_duration_s_);
  status.add("exposure [s]", settings_.exposure_s);
  status.add("gain", settings_.gain);
}

}  // namespace fringe_fusion::nodes
