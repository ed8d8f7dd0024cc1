#pragma once

#include <actionlib/server/simple_action_server.h>
#include <fringe_fusion/CalibrateCellAction.h>
#include <ros/node_handle.h>

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/sighting_from_scan.hpp"
#include "fringe_fusion/common/result.hpp"
#include "nodes/calibration_files.hpp"
#include "nodes/cell_task.hpp"
#include "nodes/target_capture.hpp"

namespace fringe_fusion::nodes {

/// Parameters of calibration_node beside those of the stages `phase`, `detect`, `transfer` and
/// `calibration`. File: config/calibration_node.yaml.
struct CalibrationNodeConfig {
  std::string calibration_file;    ///< cell.yaml in force; `accept` replaces it
  std::string target_file;         ///< target.yaml
  std::string camera_info_folder;  ///< for camera.yaml and projector.yaml; "": not written
  std::string camera_frame = "camera_optical_frame";
  int max_poses = 200;
  double server_timeout_s = 10.0;  ///< a scanner that is away for longer counts as lost
  double scan_timeout_s = 120.0;   ///< one capture of the target
  double frames_timeout_s = 5.0;   ///< from the end of a capture until its last frame is here
  double reload_timeout_s = 10.0;  ///< one node that takes a calibration
  double marker_enlarge = 500.0;   ///< factor on the residuals that are shown in space

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("calibration_file", calibration_file);
    field("target_file", target_file);
    field("camera_info_folder", camera_info_folder);
    field("camera_frame", camera_frame);
    field("max_poses", max_poses, 3, 10000);
    field("server_timeout_s", server_timeout_s, 0.1, 3600.0);
    field("scan_timeout_s", scan_timeout_s, 0.1, 3600.0);
    field("frames_timeout_s", frames_timeout_s, 0.0, 600.0);
    field("reload_timeout_s", reload_timeout_s, 0.1, 600.0);
    field("marker_enlarge", marker_enlarge, 1.0, 1e6);
  }
};

/// Calibrates step by step: action `calibrate_cell` captures poses of a target through the scanner,
/// solves, and puts an accepted solution in force in all nodes.
class CalibrationNode {
 public:
  /// @return error naming a parameter or a file.
  [[nodiscard]] static Result<std::unique_ptr<CalibrationNode>> Create(ros::NodeHandle nh,
                                                                       ros::NodeHandle private_nh);
  ~CalibrationNode();

 private:
  struct Setup {
    CalibrationNodeConfig config;
    SightingConfig sighting;
    CalibrationConfig calibration;
    std::vector<std::string> reload_nodes;
    CalibrationTarget target;
    CellCalibration in_force;
  };
  /// What every action is asked for.
  struct Step {
    std::string step;
    std::string pose;
    bool force = false;
    std::string report_folder;
  };
  /// How a step that runs is watched and stopped.
  struct Watch {
    std::function<void(const std::string& state, std::uint32_t frame, std::uint32_t num_frames)>
        feedback;
    std::function<bool()> cancelled;
  };
  template <typename Action>
  using Server = actionlib::SimpleActionServer<Action>;

  [[nodiscard]] static Result<Setup> LoadSetup(const ros::NodeHandle& private_nh);
  CalibrationNode(const ros::NodeHandle& nh, Setup setup);

  /// Runs one goal to its end.
  template <typename Action, typename Task>
  void Execute(Server<Action>& server, Task& task, const Step& step);
  /// @return what was done, in words.
  [[nodiscard]] Result<std::string> Run(CalibrationTask& task, const Step& step,
                                        const Watch& watch);
  [[nodiscard]] Result<std::string> AddPose(CalibrationTask& task, const std::string& name,
                                            const Watch& watch);

  Setup setup_;
  ros::NodeHandle nh_;
  std::mutex step_mutex_;  ///< one step at a time; guards all up to the servers
  TargetCapture capture_;
  CalibrationFiles files_;
  CellTask cell_task_;
  int num_named_ = 0;  ///< poses that got a made name
  std::atomic<bool> stopping_{false};
  Server<CalibrateCellAction> cell_server_;  ///< last: its thread uses the rest
};

}  // namespace fringe_fusion::nodes
