#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <fringe_fusion/CaptureFinding.h>
#include <ros/node_handle.h>

#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/diagnosis/diagnose_stack.hpp"

namespace fringe_fusion::nodes {

/// Examines every stack before it is decoded and says on /diagnostics, status `capture`, what is
/// wrong with it.
class CaptureWatch {
 public:
  struct Configs {
    PhaseConfig phase;
    DiagnosisConfig diagnosis;
  };
  CaptureWatch(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
               const Configs& configs);

  /// @param calibration of the scanner, where one is known that holds.
  /// @return findings, the cause of the others first. A stack that cannot be examined has none; the
  /// log and /diagnostics say why.
  std::vector<CaptureFinding> Examine(const ImageStack& stack,
                                      const std::optional<CellCalibration>& calibration);

 private:
  /// What is known since the last view.
  struct State {
    std::string view;  ///< words that name it
    std::string note;  ///< why it was not examined; empty: it was
    Diagnosis diagnosis;
  };
  void Announce(const State& state) const;
  void Show(diagnostic_updater::DiagnosticStatusWrapper& status);

  Configs configs_;
  std::mutex state_mutex_;  ///< guards what the diagnostics show
  State state_;
  diagnostic_updater::Updater diagnostics_;
  ros::Timer diagnostics_timer_;
};

}  // namespace fringe_fusion::nodes
