#include "fringe_fusion/ros_io/tf_lookup.hpp"

#include <chrono>
#include <thread>

#include "fringe_fusion/ros_io/geometry_messages.hpp"

namespace fringe_fusion::ros_io {

Result<Transform> LookupTransform(const tf2_ros::Buffer& buffer, const TransformQuery& query,
                                  double timeout_s) {
  using Clock = std::chrono::steady_clock;
  // Wall time: with a simulated clock that stands still, tf's own timeout would never pass.
  const auto deadline = Clock::now() + std::chrono::duration<double>(timeout_s);
  std::string reason;
  while (!buffer.canTransform(query.target_frame, query.source_frame, query.stamp, &reason)) {
    if (Clock::now() >= deadline) {
      return Fail("tf has no transform from {} to {} at {:.6f} s within {:.3g} s: {}",
                  query.source_frame, query.target_frame, query.stamp.toSec(), timeout_s, reason);
    }
    reason.clear();
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  try {
    return FromMessage(
        buffer.lookupTransform(query.target_frame, query.source_frame, query.stamp).transform);
  } catch (const tf2::TransformException& exception) {
    return Fail("tf cannot transform from {} to {}: {}", query.source_frame, query.target_frame,
                exception.what());
  }
}

}  // namespace fringe_fusion::ros_io
