#include "nodes/backends/sim_motion.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace fringe_fusion::nodes {

SimMotion::SimMotion(const SimMotionConfig& config, std::vector<double> joint_positions,
                     Clock clock)
    : config_(config),
      clock_(std::move(clock)),
      start_(joint_positions),
      target_(std::move(joint_positions)),
      start_s_(clock_()) {}

Status SimMotion::MoveTo(const std::vector<double>& joint_positions) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (joint_positions.size() != target_.size()) {
    return Fail("{}: {} joint positions given, must be {}", Id(), joint_positions.size(),
                target_.size());
  }
  for (const double position : joint_positions) {
    if (!std::isfinite(position))
      return Fail("{}: joint position {} is not finite", Id(), position);
  }
  const double now_s = clock_();
  const Progress progress = ProgressAt(now_s);
  if (!progress.rests_since_s) return Fail("{}: still moving, stop it first", Id());
  start_ = PositionsAt(progress.way);
  target_ = joint_positions;
  length_ = 0.0;
  for (std::size_t i = 0; i < start_.size(); ++i) {
    length_ = std::max(length_, std::abs(target_[i] - start_[i]));
  }
  start_s_ = now_s;
  stopping_ = false;
  return {};
}

Result<Motion::State> SimMotion::Poll() {
  const std::lock_guard<std::mutex> lock(mutex_);
  const double now_s = clock_();
  const Progress progress = ProgressAt(now_s);
  State state;
  state.joint_positions = PositionsAt(progress.way);
  state.joint_velocities.assign(start_.size(), 0.0);
  if (!progress.rests_since_s) {
    for (std::size_t i = 0; i < start_.size(); ++i) {
      state.joint_velocities[i] = progress.speed * (target_[i] - start_[i]) / length_;
    }
  }
  state.settled = progress.rests_since_s && now_s - *progress.rests_since_s >= config_.settle_s;
  return state;
}

Status SimMotion::Stop() {
  const std::lock_guard<std::mutex> lock(mutex_);
  const double now_s = clock_();
  const Progress progress = ProgressAt(now_s);
  if (stopping_ || progress.rests_since_s) return {};
  stop_ = progress;
  stop_s_ = now_s;
  stopping_ = true;
  return {};
}

SimMotion::Progress SimMotion::ProgressAt(double now_s) const {
  const double acceleration = config_.acceleration_rad_s2;
  if (stopping_) {
    const double brake_s = std::min(now_s - stop_s_, stop_.speed / acceleration);
    const double speed = stop_.speed - acceleration * brake_s;
    const double way = stop_.way + (stop_.speed - 0.5 * acceleration * brake_s) * brake_s;
    if (now_s - stop_s_ < stop_.speed / acceleration) return {std::min(way, length_), speed};
    return {std::min(way, length_), 0.0, stop_s_ + stop_.speed / acceleration};
  }
  // A short way never reaches full speed: half of it is spent speeding up, half braking.
  const double top_speed = std::min(config_.speed_rad_s, std::sqrt(length_ * acceleration));
  if (!(top_speed > 0.0)) return {length_, 0.0, start_s_};
  const double ramp_s = top_speed / acceleration;
  const double duration_s = length_ / top_speed + ramp_s;
  const double time_s = now_s - start_s_;
  if (time_s >= duration_s) return {length_, 0.0, start_s_ + duration_s};
  if (time_s < ramp_s) return {0.5 * acceleration * time_s * time_s, acceleration * time_s};
  const double left_s = duration_s - time_s;
  if (left_s < ramp_s) {
    return {length_ - 0.5 * acceleration * left_s * left_s, acceleration * left_s};
  }
  return {top_speed * (time_s - 0.5 * ramp_s), top_speed};
}

std::vector<double> SimMotion::PositionsAt(double way) const {
  // At the end the target itself, so that the same stop is the same number every time.
  if (way >= length_) return target_;
  std::vector<double> positions = start_;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    positions[i] += (target_[i] - start_[i]) * (way / length_);
  }
  return positions;
}

}  // namespace fringe_fusion::nodes
