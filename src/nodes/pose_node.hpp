#pragma once

#include <fringe_fusion/OptimizeViews.h>
#include <fringe_fusion/RangeView.h>
#include <fringe_fusion/ViewPoses.h>
#include <ros/node_handle.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/registration/register_views.hpp"
#include "fringe_fusion/ros_io/pose_prior.hpp"
#include "nodes/calibration_watch.hpp"
#include "nodes/coded_views.hpp"
#include "nodes/epipolar_services.hpp"

namespace fringe_fusion::nodes {

/// Parameters of pose_node beside those of the stages. File: config/pose.yaml.
struct PoseNodeConfig {
  std::string object_frame = "object";
  double tf_timeout_s = 2.0;            ///< wait for tf at the stamp of a view
  double tf_cache_s = 600.0;            ///< how far back a slow view may look
  double view_frames_rate_hz = 1.0;     ///< of the view_NNN frames in tf
  double optimize_min_timeout_s = 0.1;  ///< least wait of optimize_views for views on their way
  int max_coded_views = 24;             ///< whose codes are kept for the epipolar services

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("object_frame", object_frame);
    field("tf_timeout_s", tf_timeout_s, 0.0, 3600.0);
    field("tf_cache_s", tf_cache_s, 1.0, 86400.0);
    field("view_frames_rate_hz", view_frames_rate_hz, 0.01, 100.0);
    field("optimize_min_timeout_s", optimize_min_timeout_s, 0.0, 3600.0);
    field("max_coded_views", max_coded_views, 1, 10000);
  }
};

/// Says where every view was taken from: first by the device (tf, or the file of a resumed scan),
/// then by registering all views at once. Beside it: the health of the calibration and the epipolar
/// services, by the codes of every view.
class PoseNode {
 public:
  [[nodiscard]] static Result<std::unique_ptr<PoseNode>> Create(ros::NodeHandle nh,
                                                                ros::NodeHandle private_nh);

 private:
  struct Configs {
    PoseNodeConfig node;
    ros_io::PosePriorConfig prior;
    RegistrationConfig registration;
    CalibrationWatch::Configs epipolar;
  };
  PoseNode(ros::NodeHandle nh, ros::NodeHandle private_nh, const Configs& configs);

  void OnRangeView(const RangeView& message);
  void OnPriors(const ViewPoses& message);
  bool OnOptimize(OptimizeViews::Request& request, OptimizeViews::Response& response);
  bool OnReset(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);

  /// Finds the prior pose, keeps the view and hands it on. @return number of its points.
  [[nodiscard]] Result<int> AcceptView(const RangeView& message);
  [[nodiscard]] Result<Pose> PriorOf(const RangeView& message);
  [[nodiscard]] std::optional<Transform> PriorFromFile(const RangeView& message);
  [[nodiscard]] Result<std::vector<LitPoint>> LitPointsOf(int view_id,
                                                          const std::vector<Match>& matches,
                                                          double timeout_s);
  [[nodiscard]] Result<RegistrationResult> Register(const OptimizeViews::Request& request);
  /// Publishes the solution and remembers it. Needs the lock.
  ViewPoses Announce(const RegistrationResult& result);
  // Need the lock.
  void StartScan(const std::string& scan_id);
  void PublishState();
  void BroadcastViewFrames();

  Configs configs_;
  ros::NodeHandle nh_;
  tf2_ros::Buffer tf_buffer_;
  tf2_ros::TransformListener tf_listener_;
  tf2_ros::TransformBroadcaster tf_broadcaster_;

  std::mutex mutex_;  ///< guards all up to the publishers
  std::condition_variable views_changed_;
  std::string scan_id_;
  std::map<int, View> views_;             ///< with their prior poses
  std::map<int, Transform> view_frames_;  ///< best known T_object_camera
  ros::Duration capture_delay_;           ///< from the capture of the last view until here
  std::map<int, Transform> file_priors_;  ///< of scan file_priors_scan_id_
  std::string file_priors_scan_id_;
  std::uint32_t revision_ = 0;

  CodedViews coded_views_;
  EpipolarServices epipolar_services_;
  CalibrationWatch calibration_watch_;

  ros::Publisher view_publisher_;
  ros::Publisher poses_publisher_;
  ros::Publisher state_publisher_;
  ros::Publisher status_publisher_;
  ros::ServiceServer optimize_server_;
  ros::ServiceServer reset_server_;
  ros::Timer frames_timer_;
  ros::Subscriber priors_subscriber_;
  ros::Subscriber range_view_subscriber_;
};

}  // namespace fringe_fusion::nodes
