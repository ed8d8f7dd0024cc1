#pragma once

#include <nodelet/nodelet.h>

#include <memory>
#include <stdexcept>

#include "nodes/node_runner.hpp"

namespace fringe_fusion::nodes {

/// Makes a nodelet of a node class.
template <typename Node>
class NodeNodelet : public nodelet::Nodelet {
 private:
  void onInit() override {
    auto runner = NodeRunner<Node>::Start(getNodeHandle(), getPrivateNodeHandle());
    if (!runner) {
      NODELET_FATAL("%s cannot start: %s", getName().c_str(), runner.error().message.c_str());
      // The way in which a nodelet tells its manager that it did not load.
      throw std::runtime_error(runner.error().message);
    }
    runner_ = std::move(*runner);
  }

  std::unique_ptr<NodeRunner<Node>> runner_;
};

}  // namespace fringe_fusion::nodes
