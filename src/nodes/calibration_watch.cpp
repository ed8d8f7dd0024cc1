#include "nodes/calibration_watch.hpp"

#include <ros/console.h>
#include <ros/this_node.h>

#include <utility>
#include <vector>

#include "fringe_fusion/ros_io/picture_messages.hpp"

namespace fringe_fusion::nodes {
namespace {

using diagnostic_msgs::DiagnosticStatus;

std::uint8_t LevelOf(HealthLevel level) {
  switch (level) {
    case HealthLevel::kOk:
      return DiagnosticStatus::OK;
    case HealthLevel::kWarn:
      return DiagnosticStatus::WARN;
    case HealthLevel::kError:
      return DiagnosticStatus::ERROR;
  }
  return DiagnosticStatus::ERROR;
}

}  // namespace

CalibrationWatch::CalibrationWatch(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                                   const Configs& configs, CodedViews& views)
    : configs_(configs),
      views_(views),
      nh_(nh),
      images_(nh_),
      diagnostics_(nh, private_nh, ros::this_node::getName()) {
  residual_publisher_ = images_.advertiseCamera("epipolar_residual/image", 2);
  diagnostics_.setHardwareID("none");
  diagnostics_.add("calibration", this, &CalibrationWatch::Diagnose);
  diagnostics_timer_ =
      nh_.createTimer(ros::Duration(0.5), [this](const auto&) { diagnostics_.update(); });
  decoded_subscriber_ = nh_.subscribe<DecodedView>(
      "decoded_view", 2, [this](const DecodedView::ConstPtr& message) { OnDecoded(*message); });
}

void CalibrationWatch::OnDecoded(const DecodedView& message) {
  Result<ros_io::DecodedCodes> codes = ros_io::FromMessage(message);
  if (!codes) {
    ROS_ERROR_THROTTLE(5.0, "%s", codes.error().message.c_str());
    return;
  }
  // First what services wait for.
  const Status kept = Keep(*codes);
  State state;
  if (kept) {
    state = Judge(*codes);
  } else {
    state.note = kept.error().message;
  }
  state.view = fmt::format("view {} of scan '{}'", codes->view_id, codes->scan_id);
  state.calibration_id = CalibrationId(codes->calibration);
  if (state.report) PublishResidual(message, *state.report);
  Announce(state);
  {
    const std::lock_guard<std::mutex> lock(state_mutex_);
    state_ = std::move(state);
  }
  diagnostics_.force_update();  // Views may come faster than the period of the diagnostics.
}

Status CalibrationWatch::Keep(const ros_io::DecodedCodes& codes) {
  auto matches = SampleMatches(codes.phase, configs_.epipolar.max_matches);
  if (!matches) return Forward(matches);
  const std::vector<PhaseMap> maps{codes.phase};
  auto of_projector = TracksOfProjector(maps, codes.calibration, configs_.stations);
  if (!of_projector) return Forward(of_projector);
  auto of_camera = TracksOfCamera(maps, codes.calibration, configs_.stations);
  if (!of_camera) return Forward(of_camera);
  CodedView view;
  view.scan_id = codes.scan_id;
  view.view_id = codes.view_id;
  view.camera_frame = codes.camera_frame;
  view.projector_frame = codes.projector_frame;
  view.calibration = codes.calibration;
  view.matches = std::move(*matches);
  view.projector_tracks = std::move(*of_projector);
  view.camera_tracks = std::move(*of_camera);
  views_.Add(std::move(view));
  return {};
}

CalibrationWatch::State CalibrationWatch::Judge(const ros_io::DecodedCodes& codes) {
  State state;
  auto report = CheckHealth(codes.phase, codes.calibration, configs_.epipolar, configs_.health);
  if (!report) {
    state.note = report.error().message;
    return state;
  }
  // Drift is that of one calibration.
  if (const std::string id = CalibrationId(codes.calibration); id != history_id_) {
    history_ = HealthHistory();
    history_id_ = id;
  }
  history_.Add(codes.phase.first_stamp_ns, *report, codes.calibration);
  state.drift = history_.Fit(configs_.health);
  state.report = std::move(*report);
  return state;
}

void CalibrationWatch::Announce(const State& state) {
  const std::lock_guard<std::mutex> lock(state_mutex_);
  const bool judged_before = state_.report.has_value();
  const auto level_before = judged_before ? state_.report->level : HealthLevel::kOk;
  if (!state.report) {
    if (state.note != state_.note) {
      ROS_WARN("%s does not judge the calibration: %s", state.view.c_str(), state.note.c_str());
    }
    return;
  }
  if (state.report->level == level_before) return;
  const std::string words =
      fmt::format("calibration {} by {}: {}", HealthLevelName(state.report->level), state.view,
                  state.report->message);
  if (state.report->level == HealthLevel::kOk) {
    ROS_INFO("%s", words.c_str());
  } else {
    ROS_WARN("%s", words.c_str());
  }
}

void CalibrationWatch::PublishResidual(const DecodedView& message, const HealthReport& report) {
  if (residual_publisher_.getNumSubscribers() == 0) return;
  residual_publisher_.publish(ros_io::ToMessage(report.residual_px, message.header),
                              message.camera);
}

void CalibrationWatch::Diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(state_mutex_);
  if (state_.view.empty()) {
    status.summary(DiagnosticStatus::OK, "no view with codes has come yet");
    return;
  }
  status.add("view", state_.view);
  status.add("calibration", state_.calibration_id);
  if (!state_.report) {
    status.summary(DiagnosticStatus::WARN, "not judged: " + state_.note);
    return;
  }
  const HealthReport& report = *state_.report;
  status.summary(LevelOf(report.level), report.message);
  status.add("pixels", report.num_pixels);
  status.add("systematic [px]", report.systematic_px);
  status.add("median [px]", report.median_px);
  status.add("median absolute [px]", report.median_abs_px);
  status.add("reduced chi2", report.reduced_chi2);
  status.add("systematic after another pose [px]", report.refit_systematic_px);
  status.add("moved device", MovedDeviceName(report.motion.moved));
  status.add("turn [deg]", report.motion.turn_deg);
  status.add("baseline direction [deg]", report.motion.direction_deg);
  status.add("significance [sigma]", report.motion.significance);
  status.add("drift", state_.drift.message);
  status.add("drift is significant", state_.drift.significant);
  status.add("scans", state_.drift.num_scans);
}

}  // namespace fringe_fusion::nodes
