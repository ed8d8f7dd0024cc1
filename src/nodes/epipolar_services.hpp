#pragma once

#include <fringe_fusion/SelfCalibrate.h>
#include <fringe_fusion/SolveRelativePose.h>
#include <fringe_fusion/SolveViewPose.h>
#include <geometry_msgs/TransformStamped.h>
#include <ros/node_handle.h>
#include <tf2_ros/transform_broadcaster.h>

#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "fringe_fusion/pose/view_pose.hpp"
#include "nodes/calibration_watch.hpp"
#include "nodes/coded_views.hpp"

namespace fringe_fusion::nodes {

/// The services estimate_relative_pose, self_calibrate and estimate_view_pose, on the views that
/// CalibrationWatch has sampled. What they find is broadcast to tf under names of its own, beside
/// the calibrated frames: <projector frame>_estimated, station_NNN, view_NNN_by_projector.
class EpipolarServices {
 public:
  /// Points of a view of the present scan at the camera pixels of matches, waiting for the view up
  /// to timeout_s; error naming a view that is not there.
  using LitPointsOf = std::function<Result<std::vector<LitPoint>>(
      int view_id, const std::vector<Match>& matches, double timeout_s)>;

  EpipolarServices(ros::NodeHandle nh, const CalibrationWatch::Configs& configs, CodedViews& views,
                   LitPointsOf lit_points_of);

  /// Sends the frames found so far once more, so that they fade after Clear.
  void BroadcastFrames();
  void Clear();

 private:
  using Views = std::vector<CodedViews::Pointer>;

  bool OnRelativePose(SolveRelativePose::Request& request, SolveRelativePose::Response& response);
  bool OnSelfCalibrate(SelfCalibrate::Request& request, SelfCalibrate::Response& response);
  bool OnViewPose(SolveViewPose::Request& request, SolveViewPose::Response& response);

  [[nodiscard]] Status RelativePoseOf(const SolveRelativePose::Request& request,
                                      SolveRelativePose::Response& response);
  [[nodiscard]] Status CalibrateRig(const SelfCalibrate::Request& request, const Views& views,
                                    SelfCalibrate::Response& response);
  [[nodiscard]] Status CalibrateStations(const SelfCalibrate::Request& request, const Views& views,
                                         SelfCalibrate::Response& response);
  [[nodiscard]] Status ViewPoseOf(const SolveViewPose::Request& request,
                                  SolveViewPose::Response& response);
  /// Remembers a frame of tf and sends it.
  void AddFrame(const std::string& parent, const std::string& child,
                const geometry_msgs::Pose& pose);

  CalibrationWatch::Configs configs_;
  CodedViews& views_;
  LitPointsOf lit_points_of_;
  tf2_ros::TransformBroadcaster tf_broadcaster_;
  std::mutex frames_mutex_;
  std::map<std::string, geometry_msgs::TransformStamped> frames_;  ///< by child
  ros::ServiceServer relative_pose_server_;
  ros::ServiceServer self_calibrate_server_;
  ros::ServiceServer view_pose_server_;
};

}  // namespace fringe_fusion::nodes
