#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>

#include <memory>
#include <string>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::nodes {

/// Runs one node object on a callback queue and threads of its own, the same way for a process and
/// for a nodelet: a service that blocks never starves another node, nor its own node's other
/// callbacks. Callbacks of one node therefore run concurrently and must lock what they share.
class NodeRunner {
 public:
  /// Threads per node: one blocking service, one action, one subscriber, one timer.
  static constexpr int kNumThreads = 4;

  /// Creates a node and starts its callbacks.
  /// @param type of the node, e.g. "camera_node".
  /// @return the error of its Create, e.g. a missing parameter, or one naming an unknown parameter.
  [[nodiscard]] static Result<std::unique_ptr<NodeRunner>> Start(const std::string& type,
                                                                 ros::NodeHandle nh,
                                                                 ros::NodeHandle private_nh);

  NodeRunner(const NodeRunner&) = delete;
  NodeRunner& operator=(const NodeRunner&) = delete;
  /// Stops the callbacks before the node they belong to goes away.
  ~NodeRunner();

 private:
  NodeRunner() = default;

  ros::CallbackQueue queue_;  // First member: node and spinner refer to it.
  std::shared_ptr<void> node_;
  std::unique_ptr<ros::AsyncSpinner> spinner_;
};

}  // namespace fringe_fusion::nodes
