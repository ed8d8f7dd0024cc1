#include "nodes/capture_watch.hpp"

#include <fmt/format.h>
#include <ros/console.h>
#include <ros/this_node.h>

#include <algorithm>
#include <utility>

#include "fringe_fusion/ros_io/finding_messages.hpp"

namespace fringe_fusion::nodes {
namespace {

using diagnostic_msgs::DiagnosticStatus;

/// Frames that show other patterns spoil a view; everything else costs accuracy or points.
bool Spoils(const Finding& finding) { return finding.kind <= FindingKind::kFramesSwapped; }

}  // namespace

CaptureWatch::CaptureWatch(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                           const Configs& configs)
    : configs_(configs), diagnostics_(nh, private_nh, ros::this_node::getName()) {
  diagnostics_.setHardwareID("none");
  diagnostics_.add("capture", this, &CaptureWatch::Show);
  diagnostics_timer_ =
      nh.createTimer(ros::Duration(0.5), [this](const auto&) { diagnostics_.update(); });
}

std::vector<CaptureFinding> CaptureWatch::Examine(
    const ImageStack& stack, const std::optional<CellCalibration>& calibration) {
  State state;
  state.view = fmt::format("view {} of scan '{}'", stack.view_id, stack.scan_id);
  Result<Diagnosis> diagnosis =
      DiagnoseStack(stack, configs_.phase, configs_.diagnosis, calibration);
  if (diagnosis) {
    state.diagnosis = std::move(*diagnosis);
  } else {
    state.note = diagnosis.error().message;
  }
  Announce(state);
  const std::vector<CaptureFinding> findings = ros_io::ToMessages(state.diagnosis, stack.view_id);
  {
    const std::lock_guard<std::mutex> lock(state_mutex_);
    state_ = std::move(state);
  }
  diagnostics_.force_update();  // Views may come faster than the period of the diagnostics.
  return findings;
}

void CaptureWatch::Announce(const State& state) const {
  if (!state.note.empty()) {
    ROS_WARN("the capture of %s was not examined: %s", state.view.c_str(), state.note.c_str());
  }
  for (const Finding& finding : state.diagnosis.findings) {
    ROS_WARN("%s: %s: %s; %s", state.view.c_str(), FindingName(finding.kind),
             finding.evidence.c_str(), finding.advice.c_str());
  }
}

void CaptureWatch::Show(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(state_mutex_);
  if (state_.view.empty()) {
    status.summary(DiagnosticStatus::OK, "no view has been captured yet");
    return;
  }
  status.add("view", state_.view);
  if (!state_.note.empty()) {
    status.summary(DiagnosticStatus::WARN, "not examined: " + state_.note);
    return;
  }
  const std::vector<Finding>& findings = state_.diagnosis.findings;
  if (findings.empty()) {
    status.summary(DiagnosticStatus::OK, "nothing is wrong with the capture");
  } else {
    const bool spoilt = std::any_of(findings.begin(), findings.end(), Spoils);
    status.summary(
        spoilt ? DiagnosticStatus::ERROR : DiagnosticStatus::WARN,
        fmt::format("{}: {}", FindingName(findings.front().kind), findings.front().evidence));
  }
  for (const Finding& finding : findings) {
    const std::string name = FindingName(finding.kind);
    status.add(name + ": evidence", finding.evidence);
    status.add(name + ": advice", finding.advice);
  }
  for (const Check& check : state_.diagnosis.checks) {
    if (check.state == CheckState::kSkipped) continue;
    status.add(FindingName(check.kind), fmt::format("{:.4g}{}{}, limit {} {:.4g}", check.value,
                                                    check.unit.empty() ? "" : " ", check.unit,
                                                    check.is_minimum ? ">=" : "<=", check.limit));
  }
}

}  // namespace fringe_fusion::nodes
