// Every node as a nodelet; nodelet_plugins.xml lists the same names.
#include <pluginlib/class_list_macros.hpp>

#include "nodes/cell_node.hpp"
#include "nodes/fusion_node.hpp"
#include "nodes/node_nodelet.hpp"
#include "nodes/phase_node.hpp"
#include "nodes/pose_node.hpp"
#include "nodes/scanner_node.hpp"

namespace fringe_fusion::nodes {
using CellNodelet = NodeNodelet<CellNode>;
using FusionNodelet = NodeNodelet<FusionNode>;
using PhaseNodelet = NodeNodelet<PhaseNode>;
using PoseNodelet = NodeNodelet<PoseNode>;
using ScannerNodelet = NodeNodelet<ScannerNode>;
}  // namespace fringe_fusion::nodes

PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::CellNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::FusionNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::PhaseNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::PoseNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::ScannerNodelet, nodelet::Nodelet)
