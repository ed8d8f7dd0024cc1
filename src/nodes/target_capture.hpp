#pragma once

#include <actionlib/client/simple_action_client.h>
#include <fringe_fusion/Frame.h>
#include <fringe_fusion/ScanViewAction.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>

#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>

#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/result.hpp"
#include "nodes/action_goal.hpp"
#include "nodes/stack_assembler.hpp"

namespace fringe_fusion::nodes {

/// Captures what stands before the scanner: asks scanner_node for a view that is for a calibration
/// and collects its frames.
class TargetCapture {
 public:
  struct Limits {
    GoalLimits scan;
    double frames_timeout_s = 5.0;  ///< from the end of the scan until its last frame is here
  };
  /// @param on_frame called in any thread with the frames so far and those to come.
  using OnFrame = std::function<void(std::uint32_t count, std::uint32_t num_frames)>;

  TargetCapture(const ros::NodeHandle& nh, const Limits& limits);

  /// @return error in the words of the scanner, or kCancelled.
  [[nodiscard]] Result<ImageStack> Capture(const OnFrame& on_frame,
                                           const std::function<bool()>& cancelled);

 private:
  void OnFrameMessage(const Frame& frame);

  Limits limits_;
  ros::NodeHandle nh_;
  ros::CallbackQueue client_queue_;
  ros::NodeHandle client_nh_;  ///< with that queue
  actionlib::SimpleActionClient<ScanViewAction> client_;
  std::uint32_t num_captures_ = 0;  ///< used by Capture alone

  std::mutex mutex_;  ///< guards all up to the subscriber
  std::condition_variable frame_came_;
  std::string scan_id_;  ///< of the capture that runs
  OnFrame on_frame_;
  std::uint32_t num_frames_ = 0;  ///< of it that have come
  StackAssembler assembler_;
  std::optional<ImageStack> stack_;
  std::string failure_;  ///< of a frame of it

  ros::Subscriber subscriber_;  ///< last: the rest must stand before the first Frame
};

}  // namespace fringe_fusion::nodes
