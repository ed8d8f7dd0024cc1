#include "nodes/calibrated_frames.hpp"

#include "fringe_fusion/ros_io/configs.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"

namespace fringe_fusion::nodes {
namespace {

constexpr const char* kScannerFrame = "scanner";

geometry_msgs::TransformStamped MakeEdge(const std::string& parent, const std::string& child,
                                         const Transform& T_parent_child) {
  geometry_msgs::TransformStamped edge;
  edge.header.stamp = ros::Time::now();
  edge.header.frame_id = parent;
  edge.child_frame_id = child;
  edge.transform = ros_io::ToTransformMessage(T_parent_child);
  return edge;
}

}  // namespace

Result<std::vector<geometry_msgs::TransformStamped>> LoadEdges(const ros::NodeHandle& nh) {
  const auto names = ros_io::RequiredParameter<std::vector<std::string>>(nh, "names");
  if (!names) return Forward(names);
  std::vector<geometry_msgs::TransformStamped> edges;
  for (const std::string& name : *names) {
    const ros::NodeHandle edge_nh(nh, name);
    const auto config = ros_io::LoadConfig<FrameEdgeConfig>(edge_nh);
    if (!config) return Forward(config);
    const Result<Transform> T = MakeTransform(Eigen::Vector3d(config->translation_m.data()),
                                              Eigen::Vector4d(config->quaternion_xyzw.data()));
    if (!T) return Fail("{}: {}", edge_nh.getNamespace(), T.error().message);
    if (config->parent_frame.empty() || config->child_frame.empty()) {
      return Fail("{}: parent_frame and child_frame must not be empty", edge_nh.getNamespace());
    }
    edges.push_back(MakeEdge(config->parent_frame, config->child_frame, *T));
  }
  return edges;
}

std::vector<geometry_msgs::TransformStamped> ScannerEdges(const CellCalibration& calibration,
                                                          const std::string& camera_frame,
                                                          const std::string& projector_frame) {
  return {MakeEdge(kScannerFrame, camera_frame, Transform::Identity()),
          MakeEdge(kScannerFrame, projector_frame, calibration.T_projector_camera.inverse())};
}

}  // namespace fringe_fusion::nodes
