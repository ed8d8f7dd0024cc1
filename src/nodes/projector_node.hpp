#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <fringe_fusion/LoadSequence.h>
#include <fringe_fusion/ShowPattern.h>
#include <ros/node_handle.h>

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/capture/devices.hpp"
#include "fringe_fusion/common/image.hpp"
#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/diagnosis/response.hpp"

namespace fringe_fusion::nodes {

struct ProjectorNodeConfig {
  std::string backend = "sim";  ///< sim
  std::string frame_id = "projector_optical_frame";
  std::string calibration_file;  ///< path of cell.yaml
  double gamma = 1.0;            ///< of the projector, undone in the pictures; 1: off
  std::string response_file;     ///< response.yaml, undone instead of gamma; "": none
  double settle_s = 0.0;         ///< from the end of Show until the light is stable
  double timeout_s = 5.0;        ///< of one picture

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("backend", backend);
    field("frame_id", frame_id);
    field("calibration_file", calibration_file);
    field("gamma", gamma, 0.2, 5.0);
    field("response_file", response_file);
    field("settle_s", settle_s, 0.0, 10.0);
    field("timeout_s", timeout_s, 0.01, 600.0);
  }
};

/// Shows patterns: services `~load_sequence`, `~show_pattern` and `~reload_calibration`, latched
/// topic `projector_info`.
class ProjectorNode {
 public:
  /// @return error naming a parameter or cell.yaml.
  [[nodiscard]] static Result<std::unique_ptr<ProjectorNode>> Create(
      const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);

 private:
  ProjectorNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                ProjectorNodeConfig config, PatternCorrection correction,
                CellCalibration calibration, std::unique_ptr<Projector> projector);

  bool OnLoadSequence(LoadSequence::Request& request, LoadSequence::Response& response);
  bool OnShowPattern(ShowPattern::Request& request, ShowPattern::Response& response);
  [[nodiscard]] Status Load(const PatternList& message);
  [[nodiscard]] Status Show(std::uint32_t index);
  /// Takes calibration_file again.
  [[nodiscard]] Status ReloadCalibration();
  void PublishInfo();
  void Diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  ProjectorNodeConfig config_;
  PatternCorrection correction_;

  std::mutex projector_mutex_;  // One picture at a time; guards pictures_ and the calibration.
  CellCalibration calibration_;
  std::unique_ptr<Projector> projector_;
  std::vector<Image<std::uint8_t>> pictures_;
  PatternList loaded_;  ///< what pictures_ show

  std::mutex state_mutex_;  // Guards what the diagnostics show.
  std::string last_error_;
  std::size_t num_loaded_ = 0;
  std::uint64_t num_shown_ = 0;
  std::uint64_t num_failed_ = 0;

  ros::Publisher projector_info_;
  diagnostic_updater::Updater diagnostics_;
  ros::Timer diagnostics_timer_;
  ros::ServiceServer load_sequence_;
  ros::ServiceServer show_pattern_;
  ros::ServiceServer reload_;
};

}  // namespace fringe_fusion::nodes
