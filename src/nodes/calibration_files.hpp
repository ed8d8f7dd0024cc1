#pragma once

#include <ros/node_handle.h>

#include <functional>
#include <string>
#include <vector>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::nodes {

/// The files in which a calibration is in force, and the nodes that read them.
class CalibrationFiles {
 public:
  /// @param nodes whose `~reload_calibration` is called, in this order.
  CalibrationFiles(const ros::NodeHandle& nh, std::vector<std::string> nodes, double timeout_s)
      : nh_(nh), nodes_(std::move(nodes)), timeout_s_(timeout_s) {}

  /// What is to be put in force.
  struct Change {
    std::vector<std::string> paths;  ///< of all files that `apply` replaces
    std::function<Status()> apply;   ///< each file through a temporary one
    std::function<void()> undo;      ///< of what `apply` does beside the files; may be empty
  };

  /// Applies a change and has the nodes take it. All or nothing: when a file cannot be written or a
  /// node refuses, files and nodes get back what they had.
  /// @return error in the words of the file or the node.
  [[nodiscard]] Status Put(const Change& change);

 private:
  [[nodiscard]] Status Reload();

  ros::NodeHandle nh_;
  std::vector<std::string> nodes_;
  double timeout_s_;
};

}  // namespace fringe_fusion::nodes
