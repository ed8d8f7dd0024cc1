#include "nodes/projector_node.hpp"

#include <sensor_msgs/CameraInfo.h>

#include <utility>

#include "fringe_fusion/io/response_yaml.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/pattern/pattern_sequence.hpp"
#include "fringe_fusion/ros_io/configs.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"
#include "fringe_fusion/ros_io/pattern_messages.hpp"
#include "nodes/backends/replay_projector.hpp"
#include "nodes/backends/sim_projector.hpp"
#include "nodes/calibration_reload.hpp"

namespace fringe_fusion::nodes {
namespace {

/// What the parameters say is undone in the pictures.
Result<PatternCorrection> LoadCorrection(const ProjectorNodeConfig& config,
                                         const ros::NodeHandle& private_nh) {
  PatternCorrection correction;
  correction.gamma = config.gamma;
  if (config.response_file.empty()) return correction;
  if (config.gamma != 1.0) {
    return Fail("parameter {} is {}, must be 1 where {} is given", private_nh.resolveName("gamma"),
                config.gamma, private_nh.resolveName("response_file"));
  }
  auto response = ReadResponse(config.response_file);
  if (!response) return Forward(response);
  if (response->use == ResponseUse::kPatterns) correction.response = std::move(*response);
  return correction;
}

Result<std::unique_ptr<Projector>> MakeProjector(const ProjectorNodeConfig& config,
                                                 const PatternCorrection& correction,
                                                 const CameraModel& model,
                                                 const ros::NodeHandle& nh,
                                                 const ros::NodeHandle& private_nh) {
  ros_io::DeclareConfig<SimProjectorConfig>(ros::NodeHandle(private_nh, "sim"));
  ros_io::DeclareConfig<ReplayProjectorConfig>(ros::NodeHandle(private_nh, "replay"));
  const ros::NodeHandle backend_nh(private_nh, config.backend);
  if (config.backend == "sim") {
    const auto sim = ros_io::LoadConfig<SimProjectorConfig>(backend_nh);
    if (!sim) return Forward(sim);
    return std::make_unique<SimProjector>(nh, *sim, model.width, model.height, config.timeout_s);
  }
  if (config.backend == "replay") {
    const auto replay = ros_io::LoadConfig<ReplayProjectorConfig>(backend_nh);
    if (!replay) return Forward(replay);
    return std::make_unique<ReplayProjector>(*replay, model, correction);
  }
  return Fail("parameter {} is '{}', must be sim or replay", private_nh.resolveName("backend"),
              config.backend);
}

}  // namespace

Result<std::unique_ptr<ProjectorNode>> ProjectorNode::Create(const ros::NodeHandle& nh,
                                                             const ros::NodeHandle& private_nh) {
  const auto config = ros_io::LoadConfig<ProjectorNodeConfig>(private_nh);
  if (!config) return Forward(config);
  const Result<CellCalibration> calibration = ReadCellCalibration(config->calibration_file);
  if (!calibration) return Forward(calibration);
  const CameraModel& model = calibration->projector;
  Result<PatternCorrection> correction = LoadCorrection(*config, private_nh);
  if (!correction) return Forward(correction);
  auto made = MakeProjector(*config, *correction, model, nh, private_nh);
  if (!made) return Forward(made);
  std::unique_ptr<Projector> projector = std::move(*made);
  // A recording knows its projector once it is there, and is checked picture by picture.
  if (config->backend != "replay" &&
      projector->Id().find(calibration->projector_serial) == std::string::npos) {
    return Fail("{}: {} was calibrated with the projector of serial '{}'", projector->Id(),
                config->calibration_file, calibration->projector_serial);
  }
  return std::unique_ptr<ProjectorNode>(new ProjectorNode(
      nh, private_nh, *config, std::move(*correction), *calibration, std::move(projector)));
}

ProjectorNode::ProjectorNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                             ProjectorNodeConfig config, PatternCorrection correction,
                             CellCalibration calibration, std::unique_ptr<Projector> projector)
    : config_(std::move(config)),
      correction_(std::move(correction)),
      calibration_(std::move(calibration)),
      projector_(std::move(projector)),
      diagnostics_(nh, private_nh, ros::this_node::getName()) {
  ros::NodeHandle handle = nh;
  ros::NodeHandle private_handle = private_nh;
  projector_info_ = handle.advertise<sensor_msgs::CameraInfo>("projector_info", 1, /*latch=*/true);
  PublishInfo();
  diagnostics_.setHardwareID(projector_->Id());
  diagnostics_.add("projector", this, &ProjectorNode::Diagnose);
  diagnostics_timer_ =
      handle.createTimer(ros::Duration(0.5), [this](const auto&) { diagnostics_.update(); });
  load_sequence_ =
      private_handle.advertiseService("load_sequence", &ProjectorNode::OnLoadSequence, this);
  show_pattern_ =
      private_handle.advertiseService("show_pattern", &ProjectorNode::OnShowPattern, this);
  reload_ = AdvertiseReload(private_nh, [this] { return ReloadCalibration(); });
  ROS_INFO("%s ready, %d x %d px", projector_->Id().c_str(), projector_->Width(),
           projector_->Height());
}

void ProjectorNode::PublishInfo() {
  sensor_msgs::CameraInfo projector_info = ros_io::ToMessage(calibration_.projector);
  projector_info.header.frame_id = config_.frame_id;
  projector_info.header.stamp = ros::Time::now();
  projector_info_.publish(projector_info);
}

Status ProjectorNode::ReloadCalibration() {
  const std::lock_guard<std::mutex> lock(projector_mutex_);
  auto calibration = RereadCalibration(config_.calibration_file, calibration_);
  if (!calibration) return Forward(calibration);
  calibration_ = std::move(*calibration);
  PublishInfo();
  return {};
}

bool ProjectorNode::OnLoadSequence(LoadSequence::Request& request,
                                   LoadSequence::Response& response) {
  const std::lock_guard<std::mutex> projector_lock(projector_mutex_);
  const Status loaded = Load(request.sequence);
  const std::lock_guard<std::mutex> state_lock(state_mutex_);
  num_loaded_ = pictures_.size();
  response.success = static_cast<std::uint8_t>(loaded.has_value());
  if (!loaded) {
    response.message = loaded.error().message;
    ROS_ERROR("sequence refused: %s", response.message.c_str());
  }
  return true;
}

Status ProjectorNode::Load(const PatternList& message) {
  // Every view loads its sequence; the same one is rendered once.
  if (!pictures_.empty() && message == loaded_) return {};
  // A refused sequence leaves none behind: showing the former one would mislabel every frame.
  pictures_.clear();
  const Result<PatternSequence> sequence = ros_io::FromMessage(message);
  if (!sequence) return tl::unexpected<Error>(sequence.error());
  if (sequence->width != projector_->Width() || sequence->height != projector_->Height()) {
    return Fail("sequence for {} x {} px, but the {} has {} x {} px", sequence->width,
                sequence->height, projector_->Id(), projector_->Width(), projector_->Height());
  }
  pictures_.reserve(sequence->frames.size());
  for (const Pattern& pattern : sequence->frames) {
    pictures_.push_back(
        RenderCorrectedPattern(pattern, sequence->width, sequence->height, correction_));
  }
  loaded_ = message;
  return {};
}

bool ProjectorNode::OnShowPattern(ShowPattern::Request& request, ShowPattern::Response& response) {
  const std::lock_guard<std::mutex> projector_lock(projector_mutex_);
  const Status shown = Show(request.index);
  const std::lock_guard<std::mutex> state_lock(state_mutex_);
  response.success = static_cast<std::uint8_t>(shown.has_value());
  if (shown) {
    ++num_shown_;
    last_error_.clear();
  } else {
    ++num_failed_;
    last_error_ = shown.error().message;
    response.message = last_error_;
    ROS_ERROR_THROTTLE(5.0, "pattern %u was not shown: %s", request.index, last_error_.c_str());
  }
  return true;
}

Status ProjectorNode::Show(std::uint32_t index) {
  if (pictures_.empty()) return Fail("no sequence is loaded: call load_sequence first");
  if (index >= pictures_.size()) {
    return Fail("pattern index {} must be below {}, the length of the sequence", index,
                pictures_.size());
  }
  if (Status shown = projector_->Show(pictures_[index]); !shown) return shown;
  ros::WallDuration(config_.settle_s).sleep();
  return {};
}

void ProjectorNode::Diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(state_mutex_);
  if (!last_error_.empty()) {
    status.summary(diagnostic_msgs::DiagnosticStatus::ERROR, last_error_);
  } else {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK,
                   num_loaded_ > 0 ? "sequence loaded" : "no sequence loaded yet");
  }
  status.add("backend", config_.backend);
  status.add("patterns loaded", num_loaded_);
  status.add("patterns shown", num_shown_);
  status.add("failed", num_failed_);
}

}  // namespace fringe_fusion::nodes
