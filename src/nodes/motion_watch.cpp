#include "nodes/motion_watch.hpp"

#include <algorithm>
#include <cmath>
#include <thread>

namespace fringe_fusion::nodes {

MotionWatch::MotionWatch(ros::NodeHandle nh, const MotionWatchConfig& config) : config_(config) {
  subscriber_ = nh.subscribe<sensor_msgs::JointState>(
      "joint_states", 100,
      [this](const sensor_msgs::JointState::ConstPtr& message) { OnJointStates(*message); });
}

void MotionWatch::OnJointStates(const sensor_msgs::JointState& message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto now = Clock::now();
  const bool still = std::all_of(
      message.velocity.begin(), message.velocity.end(),
      [this](double velocity) { return std::abs(velocity) <= config_.max_velocity_rad_s; });
  // A joint that went elsewhere without telling a velocity has moved, too.
  if (!still || message.position != positions_) still_since_.reset();
  if (still && !still_since_) still_since_ = now;
  positions_ = message.position;
  last_message_ = now;
}

Result<std::vector<double>> MotionWatch::WaitSettled() {
  const auto seconds = [](double s) { return std::chrono::duration<double>(s); };
  const auto deadline = Clock::now() + seconds(config_.timeout_s);
  while (true) {
    bool heard = false;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      const auto now = Clock::now();
      heard = last_message_ && now - *last_message_ <= seconds(config_.max_age_s);
      if (heard && still_since_ && now - *still_since_ >= seconds(config_.settle_s)) {
        return positions_;
      }
    }
    if (Clock::now() >= deadline) {
      if (!heard) {
        return Fail("nothing on {} for {:.3g} s: check that the motion node runs",
                    subscriber_.getTopic(), config_.timeout_s);
      }
      return Fail("the motion has not settled below {:.3g} rad/s within {:.3g} s",
                  config_.max_velocity_rad_s, config_.timeout_s);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

}  // namespace fringe_fusion::nodes
