#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>

#include <memory>
#include <utility>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/ros_io/known_parameters.hpp"

namespace fringe_fusion::nodes {

/// Runs one node object on a callback queue and threads of its own, the same way for a process and
/// for a nodelet: a service that blocks never starves another node, nor its own node's other
/// callbacks. Callbacks of one node therefore run concurrently and must lock what they share.
template <typename Node>
class NodeRunner {
 public:
  /// Threads per node: one blocking service, one action, one subscriber, one timer.
  static constexpr int kNumThreads = 4;

  /// Creates the node by `Node::Create(nh, private_nh)` and starts its callbacks.
  /// @return the error of Create, e.g. a missing parameter, or one naming an unknown parameter.
  [[nodiscard]] static Result<std::unique_ptr<NodeRunner>> Start(ros::NodeHandle nh,
                                                                 ros::NodeHandle private_nh) {
    std::unique_ptr<NodeRunner> runner(new NodeRunner);
    nh.setCallbackQueue(&runner->queue_);
    private_nh.setCallbackQueue(&runner->queue_);
    Result<std::unique_ptr<Node>> node = Node::Create(nh, private_nh);
    if (!node) return Forward(node);
    if (Status status = ros_io::CheckNoUnknownParameter(private_nh); !status) {
      return tl::unexpected<Error>(status.error());
    }
    runner->node_ = std::move(*node);
    runner->spinner_ = std::make_unique<ros::AsyncSpinner>(kNumThreads, &runner->queue_);
    runner->spinner_->start();
    return runner;
  }

  NodeRunner(const NodeRunner&) = delete;
  NodeRunner& operator=(const NodeRunner&) = delete;
  /// Stops the callbacks before the node they belong to goes away.
  ~NodeRunner() {
    queue_.disable();
    if (spinner_) spinner_->stop();
  }

 private:
  NodeRunner() = default;

  ros::CallbackQueue queue_;  // First member: node and spinner refer to it.
  std::unique_ptr<Node> node_;
  std::unique_ptr<ros::AsyncSpinner> spinner_;
};

}  // namespace fringe_fusion::nodes
