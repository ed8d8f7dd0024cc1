#include "nodes/node_runner.hpp"

#include <ros/console.h>
#include <ros/init.h>
#include <ros/this_node.h>

#include <map>

#include "fringe_fusion/ros_io/known_parameters.hpp"
#include "nodes/calibration_node.hpp"
#include "nodes/camera_node.hpp"
#include "nodes/cell_node.hpp"
#include "nodes/cell_sim_node.hpp"
#include "nodes/fusion_node.hpp"
#include "nodes/motion_node.hpp"
#include "nodes/node_main.hpp"
#include "nodes/phase_node.hpp"
#include "nodes/pose_node.hpp"
#include "nodes/projector_node.hpp"
#include "nodes/scanner_node.hpp"

namespace fringe_fusion::nodes {
namespace {

using Create = Result<std::shared_ptr<void>> (*)(ros::NodeHandle nh, ros::NodeHandle private_nh);

template <typename Node>
Result<std::shared_ptr<void>> CreateNode(ros::NodeHandle nh, ros::NodeHandle private_nh) {
  Result<std::unique_ptr<Node>> node = Node::Create(nh, private_nh);
  if (!node) return Forward(node);
  return std::shared_ptr<void>(std::shared_ptr<Node>(std::move(*node)));
}

const std::map<std::string, Create>& Types() {
  static const std::map<std::string, Create> types = {
      {"calibration_node", CreateNode<CalibrationNode>},
      {"camera_node", CreateNode<CameraNode>},
      {"cell_node", CreateNode<CellNode>},
      {"cell_sim_node", CreateNode<CellSimNode>},
      {"fusion_node", CreateNode<FusionNode>},
      {"motion_node", CreateNode<MotionNode>},
      {"phase_node", CreateNode<PhaseNode>},
      {"pose_node", CreateNode<PoseNode>},
      {"projector_node", CreateNode<ProjectorNode>},
      {"scanner_node", CreateNode<ScannerNode>},
  };
  return types;
}

}  // namespace

Result<std::unique_ptr<NodeRunner>> NodeRunner::Start(const std::string& type, ros::NodeHandle nh,
                                                      ros::NodeHandle private_nh) {
  const auto known = Types().find(type);
  if (known == Types().end()) return Fail("there is no node of the type {}", type);
  std::unique_ptr<NodeRunner> runner(new NodeRunner);
  nh.setCallbackQueue(&runner->queue_);
  private_nh.setCallbackQueue(&runner->queue_);
  auto node = known->second(nh, private_nh);
  if (!node) return Forward(node);
  if (Status status = ros_io::CheckNoUnknownParameter(private_nh); !status) {
    return tl::unexpected<Error>(status.error());
  }
  runner->node_ = std::move(*node);
  runner->spinner_ = std::make_unique<ros::AsyncSpinner>(kNumThreads, &runner->queue_);
  runner->spinner_->start();
  return runner;
}

NodeRunner::~NodeRunner() {
  queue_.disable();
  if (spinner_) spinner_->stop();
}

int RunNode(int argc, char** argv, const std::string& type) {
  ros::init(argc, argv, type);
  // Kept until the end: the last handle that goes shuts ROS down, and then nothing is logged.
  const ros::NodeHandle nh;
  const ros::NodeHandle private_nh("~");
  const auto runner = NodeRunner::Start(type, nh, private_nh);
  if (!runner) {
    ROS_FATAL("%s cannot start: %s", ros::this_node::getName().c_str(),
              runner.error().message.c_str());
    return 1;
  }
  ros::waitForShutdown();
  return 0;
}

}  // namespace fringe_fusion::nodes
