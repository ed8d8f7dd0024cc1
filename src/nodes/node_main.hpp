#pragma once

#include <ros/console.h>
#include <ros/init.h>
#include <ros/this_node.h>

#include "nodes/node_runner.hpp"

namespace fringe_fusion::nodes {

/// Body of every node's main: runs `Node` until shutdown.
/// @return exit status: 0 after a shutdown, 1 with one line of words when the node cannot start.
template <typename Node>
int RunNode(int argc, char** argv, const char* name) {
  ros::init(argc, argv, name);
  const ros::NodeHandle nh;
  const ros::NodeHandle private_nh("~");
  const auto runner = NodeRunner<Node>::Start(nh, private_nh);
  if (!runner) {
    ROS_FATAL("%s cannot start: %s", ros::this_node::getName().c_str(),
              runner.error().message.c_str());
    return 1;
  }
  ros::waitForShutdown();
  return 0;
}

}  // namespace fringe_fusion::nodes
