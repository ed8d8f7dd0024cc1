#pragma once

#include <actionlib/server/simple_action_server.h>
#include <fringe_fusion/ScanViewAction.h>
#include <fringe_fusion/SuggestSettings.h>
#include <ros/node_handle.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/diagnosis/capture_assistant.hpp"
#include "fringe_fusion/pattern/pattern_sequence.hpp"
#include "fringe_fusion/ros_io/pose_prior.hpp"
#include "nodes/capture_watch.hpp"
#include "nodes/motion_watch.hpp"
#include "nodes/pattern_capture.hpp"
#include "nodes/scanner_config.hpp"

namespace fringe_fusion::nodes {

/// Scans one view: steps the projector, takes the frames, checks them, hands them on, writes them
/// to disk and says what is wrong with them. Publishes the calibrated edges of the tf tree; service
/// `~reload_calibration` takes them and the calibration again. Service `~suggest_settings` takes
/// test exposures and proposes how to capture.
class ScannerNode {
 public:
  [[nodiscard]] static Result<std::unique_ptr<ScannerNode>> Create(ros::NodeHandle nh,
                                                                   ros::NodeHandle private_nh);
  ~ScannerNode();

 private:
  struct Setup {
    ScannerNodeConfig config;
    ros_io::PosePriorConfig prior;
    MotionWatchConfig motion;
    PhaseConfig phase;
    DiagnosisConfig diagnosis;
    CaptureAssistantConfig assistant;
    CellCalibration calibration;
    PatternSequence sequence;
    std::vector<geometry_msgs::TransformStamped> edges;
  };
  using Server = actionlib::SimpleActionServer<ScanViewAction>;

  [[nodiscard]] static Result<Setup> LoadSetup(const ros::NodeHandle& private_nh);
  /// Edges of the parameters and those of the calibration.
  [[nodiscard]] static Result<std::vector<geometry_msgs::TransformStamped>> LoadAllEdges(
      const ros::NodeHandle& private_nh, const ScannerNodeConfig& config,
      const CellCalibration& calibration);
  ScannerNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh, Setup setup);

  void Execute(const ScanViewGoal& goal);
  [[nodiscard]] Result<ImageStack> CaptureView(const ScanViewGoal& goal);
  bool OnSuggestSettings(SuggestSettings::Request& request, SuggestSettings::Response& response);
  [[nodiscard]] Result<CaptureProposal> Suggest(const SuggestSettings::Request& request);
  [[nodiscard]] Status ReloadCalibration();
  [[nodiscard]] Status WriteView(const ImageStack& stack, const std::string& folder,
                                 const std::vector<double>& joint_positions);
  void Feedback(std::size_t frame, const char* state);
  [[nodiscard]] bool Cancelled();

  Setup setup_;
  ros::NodeHandle nh_;
  ros::NodeHandle private_nh_;
  tf2_ros::Buffer tf_buffer_;
  tf2_ros::TransformListener tf_listener_;
  tf2_ros::StaticTransformBroadcaster static_broadcaster_;
  MotionWatch motion_;
  std::mutex devices_mutex_;  ///< one sequence at a time; guards calibration and edges
  PatternCapture capture_;
  CaptureWatch watch_;
  ros::Publisher frame_publisher_;
  ros::Publisher calibration_frame_publisher_;  ///< of views that are for calibration_node
  std::atomic<bool> stopping_{false};
  ros::ServiceServer suggest_;
  ros::ServiceServer reload_;
  Server server_;  ///< last: its thread uses the rest
};

}  // namespace fringe_fusion::nodes
