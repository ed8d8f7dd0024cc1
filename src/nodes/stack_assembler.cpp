#include "nodes/stack_assembler.hpp"

#include <utility>

#include "fringe_fusion/ros_io/frame_messages.hpp"
#include "fringe_fusion/ros_io/pattern_messages.hpp"

namespace fringe_fusion::nodes {
namespace {
constexpr std::uint32_t kMaxFrames = 10000;
}  // namespace

Result<StackAssembler::Outcome> StackAssembler::Add(const Frame& frame) {
  if (frame.num_frames == 0 || frame.num_frames > kMaxFrames || frame.index >= frame.num_frames) {
    return Fail("frame {} of {} of view {} of scan '{}': index or count out of range", frame.index,
                frame.num_frames, frame.view_id, frame.scan_id);
  }
  Result<CapturedFrame> captured = ros_io::FromMessage(frame);
  if (!captured) return Forward(captured);
  const Result<Pattern> pattern = ros_io::FromMessage(frame.pattern);
  if (!pattern) return Forward(pattern);

  Outcome outcome;
  if (StartsAnew(frame)) {
    if (!missing_.empty() && missing_.size() < stack_.frames.size()) {
      outcome.discarded = fmt::format(
          "view {} of scan '{}' given up: {} of {} frames never came, the first is {}",
          stack_.view_id, stack_.scan_id, missing_.size(), stack_.frames.size(), *missing_.begin());
    }
    Start(frame);
  }
  stack_.frames[frame.index] = std::move(*captured);
  stack_.sequence.frames[frame.index] = *pattern;
  missing_.erase(frame.index);
  if (!missing_.empty()) return outcome;
  outcome.stack = std::exchange(stack_, ImageStack{});
  outcome.camera_frame = camera_frame_;
  return outcome;
}

bool StackAssembler::StartsAnew(const Frame& frame) const {
  return missing_.empty() || frame.scan_id != stack_.scan_id ||
         static_cast<int>(frame.view_id) != stack_.view_id ||
         frame.num_frames != stack_.frames.size() || (frame.index == 0 && missing_.count(0) == 0);
}

void StackAssembler::Start(const Frame& frame) {
  stack_ = ImageStack{};
  stack_.scan_id = frame.scan_id;
  stack_.view_id = static_cast<int>(frame.view_id);
  stack_.sequence.width = static_cast<int>(frame.projector_width);
  stack_.sequence.height = static_cast<int>(frame.projector_height);
  stack_.sequence.frames.resize(frame.num_frames);
  stack_.frames.resize(frame.num_frames);
  camera_frame_ = frame.header.frame_id;
  missing_.clear();
  for (std::uint32_t i = 0; i < frame.num_frames; ++i) missing_.insert(missing_.end(), i);
}

}  // namespace fringe_fusion::nodes
