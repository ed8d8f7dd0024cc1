#include "nodes/stack_assembler.hpp"

#include <algorithm>
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
  auto open = std::find_if(open_.begin(), open_.end(), [&frame](const Open& candidate) {
    return candidate.stack.scan_id == frame.scan_id &&
           candidate.stack.view_id == static_cast<int>(frame.view_id);
  });
  const bool repeated = open != open_.end() && (frame.num_frames != open->stack.frames.size() ||
                                                (frame.index == 0 && open->missing.count(0) == 0));
  if (repeated) outcome.discarded = GiveUp(std::exchange(open, open_.end()));
  if (open == open_.end()) {
    if (open_.size() >= kMaxOpen) outcome.discarded = GiveUp(open_.begin());
    open = open_.insert(open_.end(), Start(frame));
  }
  open->stack.frames[frame.index] = std::move(*captured);
  open->stack.sequence.frames[frame.index] = *pattern;
  open->missing.erase(frame.index);
  if (!open->missing.empty()) return outcome;
  outcome.stack = std::move(open->stack);
  outcome.camera_frame = open->camera_frame;
  open_.erase(open);
  return outcome;
}

StackAssembler::Open StackAssembler::Start(const Frame& frame) {
  Open open;
  open.stack.scan_id = frame.scan_id;
  open.stack.view_id = static_cast<int>(frame.view_id);
  open.stack.sequence.width = static_cast<int>(frame.projector_width);
  open.stack.sequence.height = static_cast<int>(frame.projector_height);
  open.stack.sequence.frames.resize(frame.num_frames);
  open.stack.frames.resize(frame.num_frames);
  open.camera_frame = frame.header.frame_id;
  for (std::uint32_t i = 0; i < frame.num_frames; ++i) open.missing.insert(i);
  return open;
}

std::string StackAssembler::GiveUp(std::list<Open>::iterator open) {
  const std::string words =
      fmt::format("view {} of scan '{}' given up: {} of {} frames never came, the first is {}",
                  open->stack.view_id, open->stack.scan_id, open->missing.size(),
                  open->stack.frames.size(), *open->missing.begin());
  open_.erase(open);
  return words;
}

}  // namespace fringe_fusion::nodes
