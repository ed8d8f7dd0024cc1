// Every node as a nodelet; nodelet_plugins.xml lists the same names.
#include <nodelet/nodelet.h>

#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <stdexcept>
#include <utility>

#include "nodes/node_runner.hpp"

namespace fringe_fusion::nodes {

class NodeNodelet : public nodelet::Nodelet {
 public:
  explicit NodeNodelet(const char* type) : type_(type) {}

 private:
  void onInit() override {
    auto runner = NodeRunner::Start(type_, getNodeHandle(), getPrivateNodeHandle());
    if (!runner) {
      NODELET_FATAL("%s cannot start: %s", getName().c_str(), runner.error().message.c_str());
      // The way in which a nodelet tells its manager that it did not load.
      throw std::runtime_error(runner.error().message);
    }
    runner_ = std::move(*runner);
  }

  const char* type_;
  std::unique_ptr<NodeRunner> runner_;
};

struct CalibrationNodelet : NodeNodelet {
  CalibrationNodelet() : NodeNodelet("calibration_node") {}
};
struct CameraNodelet : NodeNodelet {
  CameraNodelet() : NodeNodelet("camera_node") {}
};
struct CellNodelet : NodeNodelet {
  CellNodelet() : NodeNodelet("cell_node") {}
};
struct CellSimNodelet : NodeNodelet {
  CellSimNodelet() : NodeNodelet("cell_sim_node") {}
};
struct FusionNodelet : NodeNodelet {
  FusionNodelet() : NodeNodelet("fusion_node") {}
};
struct MotionNodelet : NodeNodelet {
  MotionNodelet() : NodeNodelet("motion_node") {}
};
struct PhaseNodelet : NodeNodelet {
  PhaseNodelet() : NodeNodelet("phase_node") {}
};
struct PoseNodelet : NodeNodelet {
  PoseNodelet() : NodeNodelet("pose_node") {}
};
struct ProjectorNodelet : NodeNodelet {
  ProjectorNodelet() : NodeNodelet("projector_node") {}
};
struct ScannerNodelet : NodeNodelet {
  ScannerNodelet() : NodeNodelet("scanner_node") {}
};
}  // namespace fringe_fusion::nodes

PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::CalibrationNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::CameraNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::CellNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::CellSimNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::FusionNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::MotionNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::PhaseNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::PoseNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::ProjectorNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(fringe_fusion::nodes::ScannerNodelet, nodelet::Nodelet)
