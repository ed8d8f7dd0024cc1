#include "nodes/target_capture.hpp"

#include <ros/time.h>

#include <utility>

namespace fringe_fusion::nodes {
namespace {
constexpr std::uint32_t kFrameQueueSize = 200;
}  // namespace

TargetCapture::TargetCapture(const ros::NodeHandle& nh, const Limits& limits)
    : limits_(limits),
      nh_(nh),
      client_nh_(WithQueue(nh, client_queue_)),
      client_(client_nh_, "scan_view", /*spin_thread=*/false) {
  subscriber_ =
      nh_.subscribe<Frame>("calibration_frames", kFrameQueueSize,
                           [this](const Frame::ConstPtr& frame) { OnFrameMessage(*frame); });
}

Result<ImageStack> TargetCapture::Capture(const OnFrame& on_frame,
                                          const std::function<bool()>& cancelled) {
  ScanViewGoal goal;
  goal.scan_id = fmt::format("calibration_{}", ros::WallTime::now().toNSec() / 1000000U);
  goal.view_id = num_captures_++;
  goal.calibration = 1;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    scan_id_ = goal.scan_id;
    on_frame_ = on_frame;
    num_frames_ = 0;
    stack_.reset();
    failure_.clear();
  }
  const auto scanned =
      RunGoal<ScanViewResult>(client_, client_queue_, goal, "scan_view", limits_.scan, cancelled);
  std::unique_lock<std::mutex> lock(mutex_);
  if (scanned) {
    frame_came_.wait_for(lock, std::chrono::duration<double>(limits_.frames_timeout_s),
                         [this] { return stack_ || !failure_.empty(); });
  }
  on_frame_ = nullptr;
  scan_id_.clear();
  if (!scanned) return Forward(scanned);
  if (!failure_.empty()) return Fail("{}", failure_);
  if (!stack_) {
    return Fail("{} of {} frames of the target have come on {} within {:.3g} s", num_frames_,
                scanned->num_frames, subscriber_.getTopic(), limits_.frames_timeout_s);
  }
  ImageStack stack = std::move(*stack_);
  stack_.reset();
  return stack;
}

void TargetCapture::OnFrameMessage(const Frame& frame) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (frame.scan_id != scan_id_) return;
  Result<StackAssembler::Outcome> outcome = assembler_.Add(frame);
  if (!outcome) {
    failure_ = outcome.error().message;
  } else {
    ++num_frames_;
    if (on_frame_) on_frame_(num_frames_, frame.num_frames);
    if (outcome->stack) stack_ = std::move(outcome->stack);
  }
  frame_came_.notify_all();
}

}  // namespace fringe_fusion::nodes
