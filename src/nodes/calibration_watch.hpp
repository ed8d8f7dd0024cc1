#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <fringe_fusion/DecodedView.h>
#include <image_transport/image_transport.h>
#include <ros/node_handle.h>

#include <mutex>
#include <optional>
#include <string>

#include "fringe_fusion/pose/epipolar_health.hpp"
#include "fringe_fusion/pose/stations.hpp"
#include "fringe_fusion/ros_io/phase_messages.hpp"
#include "nodes/coded_views.hpp"

namespace fringe_fusion::nodes {

/// Judges the calibration by the codes of every view, on /diagnostics and as a picture of the
/// residuals on epipolar_residual/image, and samples the codes for the epipolar services.
class CalibrationWatch {
 public:
  struct Configs {
    EpipolarConfig epipolar;
    HealthConfig health;
    StationsConfig stations;
  };
  /// @param views kept by the caller, longer than this object.
  CalibrationWatch(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                   const Configs& configs, CodedViews& views);

 private:
  /// What is known since the last view.
  struct State {
    std::string view;  ///< words that name it
    std::string calibration_id;
    std::string note;  ///< why it was not judged; empty: it was
    std::optional<HealthReport> report;
    Drift drift;
  };
  void OnDecoded(const DecodedView& message);
  /// Samples the codes and hands them to `views`.
  [[nodiscard]] Status Keep(const ros_io::DecodedCodes& codes);
  /// Judges the calibration by one view. Without the lock: it takes its time.
  [[nodiscard]] State Judge(const ros_io::DecodedCodes& codes);
  void Announce(const State& state);
  void PublishResidual(const DecodedView& message, const HealthReport& report);
  void Diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  Configs configs_;
  CodedViews& views_;
  ros::NodeHandle nh_;
  image_transport::ImageTransport images_;
  image_transport::CameraPublisher residual_publisher_;

  HealthHistory history_;  ///< of calibration history_id_; used by OnDecoded alone
  std::string history_id_;

  std::mutex state_mutex_;  ///< guards what the diagnostics show
  State state_;
  diagnostic_updater::Updater diagnostics_;
  ros::Timer diagnostics_timer_;
  ros::Subscriber decoded_subscriber_;  ///< last: the rest must stand before the first view
};

}  // namespace fringe_fusion::nodes
