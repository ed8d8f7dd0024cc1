#pragma once

#include <fringe_fusion/CalibrateHandEyeResult.h>
#include <fringe_fusion/CalibrateTurntableResult.h>
#include <ros/node_handle.h>
#include <tf2_ros/buffer.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/hand_eye.hpp"
#include "fringe_fusion/calibration/turntable_axis.hpp"
#include "fringe_fusion/io/device_files.hpp"
#include "nodes/calibration_files.hpp"
#include "nodes/calibration_task.hpp"

namespace fringe_fusion::nodes {

/// What the calibrations of devices that move share.
struct DeviceContext {
  std::string camera_frame;
  std::string edges_file;    ///< calibrated edges in force; "": nothing can be accepted
  std::string scanner_node;  ///< whose ~edges are set
  double tf_timeout_s = 2.0;
  CalibrationTarget target;
  std::function<CellCalibration()> devices;  ///< in force
};

/// A calibration by poses of a target and what a device says of itself at each, from tf.
class DeviceTask : public CalibrationTask {
 public:
  /// @param tf, files kept by the caller, longer than this object.
  DeviceTask(const ros::NodeHandle& nh, DeviceContext context, const tf2_ros::Buffer& tf,
             CalibrationFiles& files);

  [[nodiscard]] std::vector<std::string> Names() const override;
  [[nodiscard]] Result<std::string> Add(const SightedTarget& seen) override;
  [[nodiscard]] Result<std::string> Remove(const std::string& name) override;
  void Reset() override;
  [[nodiscard]] Result<std::string> Solve(const std::string& report_folder) override;
  [[nodiscard]] Result<std::string> Accept(bool force) override;

 protected:
  struct DeviceFrames {
    std::string rest;
    std::string moving;
  };
  [[nodiscard]] virtual DeviceFrames Frames() const = 0;
  /// Solves and keeps the result. @return the verdict.
  [[nodiscard]] virtual Result<Verdict> SolvePoses() = 0;
  /// The edge of the last result. @param edges in force.
  [[nodiscard]] virtual Result<FrameEdge> Edge(const std::vector<FrameEdge>& edges) const = 0;

  [[nodiscard]] const DeviceContext& context() const { return context_; }
  [[nodiscard]] const tf2_ros::Buffer& tf() const { return tf_; }
  [[nodiscard]] const std::vector<TargetSighting>& sightings() const { return sightings_; }
  /// T_rest_moving of every pose.
  [[nodiscard]] const std::vector<Transform>& readings() const { return readings_; }
  /// What the present poses were found to be worth; nothing before they are solved.
  [[nodiscard]] const std::optional<Verdict>& verdict() const { return verdict_; }

 private:
  void SetEdges(const std::vector<FrameEdge>& edges) const;

  ros::NodeHandle nh_;
  DeviceContext context_;
  const tf2_ros::Buffer& tf_;
  CalibrationFiles& files_;
  std::vector<TargetSighting> sightings_;
  std::vector<Transform> readings_;
  std::optional<Verdict> verdict_;
};

/// Frames and words of a hand-eye. Parameters of ~hand_eye_frames.
struct HandEyeSetup {
  std::string mount = "eye_in_hand";  ///< eye_in_hand or eye_to_hand
  std::string base_frame = "cell";    ///< at rest, in which tf has the flange
  std::string flange_frame = "tool0";

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("mount", mount);
    field("base_frame", base_frame);
    field("flange_frame", flange_frame);
  }
};

/// Where the camera sits on the flange, or stands before the arm.
class HandEyeTask : public DeviceTask {
 public:
  struct Setup {
    HandEyeSetup frames;
    HandEyeMount mount = HandEyeMount::kEyeInHand;
    HandEyeConfig config;
  };
  HandEyeTask(const ros::NodeHandle& nh, DeviceContext context, const tf2_ros::Buffer& tf,
              CalibrationFiles& files, Setup setup);
  [[nodiscard]] CalibrateHandEyeResult Message() const;

 protected:
  [[nodiscard]] DeviceFrames Frames() const override;
  [[nodiscard]] Result<Verdict> SolvePoses() override;
  [[nodiscard]] Result<FrameEdge> Edge(const std::vector<FrameEdge>& edges) const override;

 private:
  Setup setup_;
  HandEyeResult result_;
};

/// Frames of a turntable. Parameters of ~turntable_frames.
struct TurntableSetup {
  std::string base_frame = "turntable_base";  ///< at rest
  std::string table_frame = "turntable";      ///< turns about its z axis

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("base_frame", base_frame);
    field("table_frame", table_frame);
  }
};

/// Where the axis of the turntable is.
class TurntableTask : public DeviceTask {
 public:
  TurntableTask(const ros::NodeHandle& nh, DeviceContext context, const tf2_ros::Buffer& tf,
                CalibrationFiles& files, TurntableSetup setup, const TurntableConfig& config);
  [[nodiscard]] CalibrateTurntableResult Message() const;

 protected:
  [[nodiscard]] DeviceFrames Frames() const override;
  [[nodiscard]] Result<Verdict> SolvePoses() override;
  [[nodiscard]] Result<FrameEdge> Edge(const std::vector<FrameEdge>& edges) const override;

 private:
  TurntableSetup setup_;
  TurntableConfig config_;
  TurntableResult result_;
};

}  // namespace fringe_fusion::nodes
