#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <ros/node_handle.h>

#include <string>
#include <vector>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::nodes {

/// One calibrated edge of the tf tree: T_parent_child.
struct FrameEdgeConfig {
  std::string parent_frame;
  std::string child_frame;
  std::array<double, 3> translation_m{{0.0, 0.0, 0.0}};
  std::array<double, 4> quaternion_xyzw{{0.0, 0.0, 0.0, 1.0}};

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("parent_frame", parent_frame);
    field("child_frame", child_frame);
    field("translation_m", translation_m, -1000.0, 1000.0);
    field("quaternion_xyzw", quaternion_xyzw, -1.0, 1.0);
  }
};

/// Reads the edges that the list parameter `names` of `nh` names, each from `nh/<name>`.
/// @return error naming the edge and what is wrong with it.
[[nodiscard]] Result<std::vector<geometry_msgs::TransformStamped>> LoadEdges(
    const ros::NodeHandle& nh);

/// scanner -> camera and scanner -> projector of a calibration; the scanner frame is the camera's.
[[nodiscard]] std::vector<geometry_msgs::TransformStamped> ScannerEdges(
    const CellCalibration& calibration, const std::string& camera_frame,
    const std::string& projector_frame);

}  // namespace fringe_fusion::nodes
