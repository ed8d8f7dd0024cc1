#pragma once

#include <ros/node_handle.h>
#include <sensor_msgs/JointState.h>

#include <chrono>
#include <mutex>
#include <optional>
#include <vector>

#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::nodes {

/// When a motion counts as settled.
struct MotionWatchConfig {
  double max_velocity_rad_s = 1e-6;  ///< of every joint
  double settle_s = 0.05;            ///< for at least this long
  double timeout_s = 10.0;           ///< give up waiting
  double max_age_s = 1.0;            ///< an older joint_states message says nothing

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("max_velocity_rad_s", max_velocity_rad_s, 0.0, 10.0);
    field("settle_s", settle_s, 0.0, 60.0);
    field("timeout_s", timeout_s, 0.0, 3600.0);
    field("max_age_s", max_age_s, 0.01, 60.0);
  }
};

/// Knows from joint_states whether the cell stands still.
class MotionWatch {
 public:
  MotionWatch(ros::NodeHandle nh, const MotionWatchConfig& config);

  /// Waits until all joints have stood still for settle_s.
  /// @return joint positions; error when they move on, or when nothing is heard of them.
  [[nodiscard]] Result<std::vector<double>> WaitSettled();

 private:
  using Clock = std::chrono::steady_clock;
  void OnJointStates(const sensor_msgs::JointState& message);

  MotionWatchConfig config_;
  std::mutex mutex_;  ///< guards the next three
  std::vector<double> positions_;
  std::optional<Clock::time_point> last_message_;
  std::optional<Clock::time_point> still_since_;
  ros::Subscriber subscriber_;
};

}  // namespace fringe_fusion::nodes
