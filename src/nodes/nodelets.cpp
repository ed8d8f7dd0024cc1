// Every node as a nodelet; nodelet_plugins.xml lists the same names.
#include <pluginlib/class_list_macros.hpp>

#include "nodes/camera_node.hpp"
#include "nodes/cell_node.hpp"
#include "nodes/cell_sim_node.hpp"
#include "nodes/fusion_node.hpp"
#include "nodes/motion_node.hpp"
#include "nodes/node_nodelet.hpp"
#include "nodes/phase_node.hpp"
#include "nodes/pose_node.hpp"
#include "nodes/projector_node.hpp"
#include "nodes/scanner_node.hpp"

namespace fringe_fusion::nodes {
using CameraNodelet = NodeNodelet<CameraNode>;
using CellNodelet = NodeNodelet<CellNode>;
using CellSimNodelet = NodeNodelet<CellSimNode>;
using FusionNodelet = NodeNodelet<FusionNode>;
using MotionNodelet = NodeNodelet<MotionNode>;
using PhaseNodelet = NodeNodelet<PhaseNode>;
using PoseNodelet = NodeNodelet<PoseNode>;
using ProjectorNodelet = NodeNodelet<ProjectorNode>;
using ScannerNodelet = NodeNodelet<ScannerNode>;
}  // namespace fringe_fusion::nodes

PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::CameraNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::CellNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::CellSimNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::FusionNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::MotionNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::PhaseNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::PoseNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::ProjectorNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::ScannerNodelet, nodelet::Nodelet)
