#pragma once

#include <actionlib/server/simple_action_server.h>
#include <fringe_fusion/CalibrateCellAction.h>
#include <fringe_fusion/CalibrateHandEyeAction.h>
#include <fringe_fusion/CalibrateTurntableAction.h>
#include <ros/node_handle.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

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
#include "nodes/device_task.hpp"
#include "nodes/target_capture.hpp"

namespace fringe_fusion::nodes {

/// Parameters of calibration_node beside those of the stages `phase`, `detect`, `transfer`,
/// `calibration`, `hand_eye` and `turntable`, and the frames `hand_eye_frames` and
/// `turntable_frames`. File: config/calibration_node.yaml.
struct CalibrationNodeConfig {
  std::string calibration_file;    ///< cell.yaml in force; `accept` replaces it
  std::string target_file;         ///< target.yaml
  std::string camera_info_folder;  ///< for camera.yaml and projector.yaml; "": not written
  std::string edges_file;          ///< edges in force; "": none, so no axis or hand-eye is accepted
  std::string scanner_node = "scanner_node";  ///< whose ~edges are set
  std::string camera_frame = "camera_optical_frame";
  int max_poses = 200;
  double server_timeout_s = 10.0;  ///< a scanner that is away for longer counts as lost
  double scan_timeout_s = 120.0;   ///< one capture of the target
  double frames_timeout_s = 5.0;   ///< from the end of a capture until its last frame is here
  double reload_timeout_s = 10.0;  ///< one node that takes a calibration
  double tf_timeout_s = 2.0;       ///< wait for tf to reach the time of a capture
  double marker_enlarge = 500.0;   ///< factor on the residuals that are shown in space

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("calibration_file", calibration_file);
    field("target_file", target_file);
    field("camera_info_folder", camera_info_folder);
    field("edges_file", edges_file);
    field("scanner_node", scanner_node);
    field("camera_frame", camera_frame);
    field("max_poses", max_poses, 3, 10000);
    field("server_timeout_s", server_timeout_s, 0.1, 3600.0);
    field("scan_timeout_s", scan_timeout_s, 0.1, 3600.0);
    field("frames_timeout_s", frames_timeout_s, 0.0, 600.0);
    field("reload_timeout_s", reload_timeout_s, 0.1, 600.0);
    field("tf_timeout_s", tf_timeout_s, 0.0, 600.0);
    field("marker_enlarge", marker_enlarge, 1.0, 1e6);
  }
};

/// Calibrates step by step: the actions `calibrate_cell`, `calibrate_hand_eye` and
/// `calibrate_turntable` capture poses of a target through the scanner, solve, and put an accepted
/// solution in force in all nodes.
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
    HandEyeConfig hand_eye;
    HandEyeSetup hand_eye_frames;
    HandEyeMount mount = HandEyeMount::kEyeInHand;
    TurntableConfig turntable;
    TurntableSetup turntable_frames;
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
  [[nodiscard]] static Status LoadDevices(const ros::NodeHandle& private_nh, Setup& setup);
  CalibrationNode(const ros::NodeHandle& nh, Setup setup);
  /// What the tasks of devices that move need.
  [[nodiscard]] DeviceContext Devices() const;

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
  tf2_ros::Buffer tf_buffer_;
  tf2_ros::TransformListener tf_listener_;
  CellTask cell_task_;
  HandEyeTask hand_eye_task_;
  TurntableTask turntable_task_;
  int num_named_ = 0;  ///< poses that got a made name
  std::atomic<bool> stopping_{false};
  // Last: their threads use the rest.
  Server<CalibrateCellAction> cell_server_;
  Server<CalibrateHandEyeAction> hand_eye_server_;
  Server<CalibrateTurntableAction> turntable_server_;
};

}  // namespace fringe_fusion::nodes
