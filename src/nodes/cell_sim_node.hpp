#pragma once

#include <fringe_fusion/SimExpose.h>
#include <fringe_fusion/SimPlace.h>
#include <fringe_fusion/SimProject.h>
#include <ros/node_handle.h>
#include <sensor_msgs/JointState.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <array>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"
#include "nodes/backends/gige_server.hpp"
#include "nodes/truth_folder.hpp"

namespace fringe_fusion::nodes {

struct CellSimNodeConfig {
  std::string calibration_file;     ///< path of cell.yaml: the true geometry of both devices
  std::string object;               ///< name of a gauge, or path of a mesh file [m]
  std::string target_file;          ///< target.yaml: its plate stands there instead; "": the object
  double target_softness_m = 1e-4;  ///< Gaussian sigma of the edges of the target's print
  std::array<double, 3> target_translation_m{};  ///< T_object_target at first
  std::array<double, 4> target_quaternion_xyzw{{0.0, 0.0, 0.0, 1.0}};
  double plate_radius_m = 0.1;  ///< turntable plate below the object; 0: none
  double plate_thickness_m = 0.01;
  std::string object_frame = "object";
  std::string camera_frame = "camera_optical_frame";
  std::string truth_folder;   ///< the true surface is written there; empty: off
  double tf_timeout_s = 2.0;  ///< wait for tf to reach the last joint state

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("calibration_file", calibration_file);
    field("object", object);
    field("target_file", target_file);
    field("target_softness_m", target_softness_m, 0.0, 0.01);
    field("target_translation_m", target_translation_m, -10.0, 10.0);
    field("target_quaternion_xyzw", target_quaternion_xyzw, -1.0, 1.0);
    field("plate_radius_m", plate_radius_m, 0.0, 10.0);
    field("plate_thickness_m", plate_thickness_m, 1e-6, 10.0);
    field("object_frame", object_frame);
    field("camera_frame", camera_frame);
    field("truth_folder", truth_folder);
    field("tf_timeout_s", tf_timeout_s, 0.0, 60.0);
  }
};

/// The simulated cell behind the devices' interfaces: services `~project` and `~expose`, and a GigE
/// Vision camera if configured. With a target, service `~place_target` moves it. What only a
/// simulation knows is on `~truth/pose` and
/// `~truth/points`, latched, for tests alone.
class CellSimNode {
 public:
  /// @return error naming a parameter, cell.yaml or the object.
  [[nodiscard]] static Result<std::unique_ptr<CellSimNode>> Create(
      const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);

 private:
  /// What stands in the cell.
  struct Scene {
    Mesh object;  ///< or the plate of the target
    Mesh background;
    std::optional<sim::SurfacePrint> print;
  };
  CellSimNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
              CellSimNodeConfig config, sim::SimCell cell, Scene scene);
  [[nodiscard]] static Result<Scene> MakeScene(const CellSimNodeConfig& config);
  [[nodiscard]] Status StartTruthFolder(const Mesh& object);
  [[nodiscard]] Status StartGige(const GigeServerConfig& config);

  bool OnProject(SimProject::Request& request, SimProject::Response& response);
  bool OnExpose(SimExpose::Request& request, SimExpose::Response& response);
  bool OnPlaceTarget(SimPlace::Request& request, SimPlace::Response& response);
  [[nodiscard]] Status PlaceTarget(const Transform& T_object_target);
  void OnJointState(const sensor_msgs::JointStateConstPtr& message);

  /// One exposure that takes its time, stamped by the host's clock.
  [[nodiscard]] Result<CapturedFrame> Expose(double exposure_s);
  /// Moves the cell to where tf says it stands. Needs cell_mutex_.
  [[nodiscard]] Status UpdatePose();
  void PublishTruth(const ros::Time& stamp);

  CellSimNodeConfig config_;

  std::mutex joint_mutex_;
  sensor_msgs::JointStateConstPtr joint_state_;

  std::mutex cell_mutex_;  // Guards what follows.
  sim::SimCell cell_;
  Scene scene_;
  int num_placed_ = 0;  // Times that the target was put elsewhere.
  Image<std::uint8_t> picture_;
  std::optional<Transform> T_object_camera_;  // Commanded, of the rays that are cast.
  int pose_index_ = 0;
  int frame_index_ = 0;
  std::optional<TruthFolder> truth_folder_;

  tf2_ros::Buffer tf_buffer_;
  tf2_ros::TransformListener tf_listener_;
  ros::Publisher truth_pose_;
  ros::Publisher truth_points_;
  ros::Subscriber joint_states_;
  ros::ServiceServer project_;
  ros::ServiceServer expose_;
  ros::ServiceServer place_target_;
  std::unique_ptr<GigeServer> gige_server_;  // Last: its thread uses all of the above.
};

}  // namespace fringe_fusion::nodes
