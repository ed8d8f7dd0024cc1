#pragma once

#include <actionlib/server/simple_action_server.h>
#include <fringe_fusion/ScanViewAction.h>
#include <ros/node_handle.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/pattern/pattern_sequence.hpp"
#include "fringe_fusion/ros_io/pose_prior.hpp"
#include "nodes/motion_watch.hpp"

namespace fringe_fusion::nodes {

/// Parameters of scanner_node beside `pattern`, `prior`, `motion` and `edges`.
/// File: config/scanner.yaml.
struct ScannerNodeConfig {
  std::string calibration_file;  ///< cell.yaml
  std::string camera_frame = "camera_optical_frame";
  std::string projector_frame = "projector_optical_frame";
  std::string object_frame = "object";
  std::string camera_node = "camera_node";        ///< whose ~capture is called
  std::string projector_node = "projector_node";  ///< whose ~show_pattern is called
  double exposure_s = 0.02;
  double gain = 1.0;
  double show_timeout_s = 8.0;
  double capture_timeout_s = 5.0;  ///< what the camera is given for one frame
  double service_timeout_s = 5.0;  ///< a node that is silent for longer counts as hung
  double tf_timeout_s = 1.0;
  double tf_cache_s = 600.0;         ///< how far back the first frame of a slow view may lie
  double stamp_tolerance_s = 0.002;  ///< a frame stamped earlier shows another pattern
  int max_retries = 3;               ///< per frame

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("calibration_file", calibration_file);
    field("camera_frame", camera_frame);
    field("projector_frame", projector_frame);
    field("object_frame", object_frame);
    field("camera_node", camera_node);
    field("projector_node", projector_node);
    field("exposure_s", exposure_s, 1e-6, 100.0);
    field("gain", gain, 0.0, 1000.0);
    field("show_timeout_s", show_timeout_s, 0.01, 600.0);
    field("capture_timeout_s", capture_timeout_s, 0.01, 600.0);
    field("service_timeout_s", service_timeout_s, 0.01, 600.0);
    field("tf_timeout_s", tf_timeout_s, 0.0, 600.0);
    field("tf_cache_s", tf_cache_s, 1.0, 86400.0);
    field("stamp_tolerance_s", stamp_tolerance_s, 0.0, 10.0);
    field("max_retries", max_retries, 0, 1000);
  }
};

/// Scans one view: steps the projector, takes the frames, checks them, hands them on and writes
/// them to disk. Publishes the calibrated edges of the tf tree.
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
    CellCalibration calibration;
    PatternSequence sequence;
    std::vector<geometry_msgs::TransformStamped> edges;
  };
  using Server = actionlib::SimpleActionServer<ScanViewAction>;

  [[nodiscard]] static Result<Setup> LoadSetup(const ros::NodeHandle& private_nh);
  ScannerNode(ros::NodeHandle nh, Setup setup);

  void Execute(const ScanViewGoal& goal);
  /// Steps through the sequence; on_frame of the stack so far is published.
  [[nodiscard]] Result<ImageStack> CaptureView(const ScanViewGoal& goal);
  [[nodiscard]] Status LoadSequence();
  [[nodiscard]] Result<CapturedFrame> CaptureFrame(const ScanViewGoal& goal, std::size_t index,
                                                   std::int64_t previous_ns);
  [[nodiscard]] Result<CapturedFrame> TryFrame(const ScanViewGoal& goal, std::size_t index,
                                               std::int64_t previous_ns);
  [[nodiscard]] Status CheckFrame(const CapturedFrame& frame, std::int64_t earliest_ns,
                                  std::int64_t previous_ns) const;
  [[nodiscard]] Status WriteView(const ImageStack& stack, const std::string& folder,
                                 const std::vector<double>& joint_positions);
  void Feedback(std::size_t frame, const char* state);
  [[nodiscard]] bool Cancelled();

  Setup setup_;
  ros::NodeHandle nh_;
  tf2_ros::Buffer tf_buffer_;
  tf2_ros::TransformListener tf_listener_;
  tf2_ros::StaticTransformBroadcaster static_broadcaster_;
  MotionWatch motion_;
  ros::Publisher frame_publisher_;
  std::atomic<bool> stopping_{false};
  Server server_;  ///< last: its thread uses the rest
};

}  // namespace fringe_fusion::nodes
