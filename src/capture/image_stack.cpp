#include "fringe_fusion/capture/image_stack.hpp"

namespace fringe_fusion {

int Width(const CapturedFrame& frame) {
  return std::visit([](const auto& image) { return image.width(); }, frame.pixels);
}

int Height(const CapturedFrame& frame) {
  return std::visit([](const auto& image) { return image.height(); }, frame.pixels);
}

Status Validate(const ImageStack& stack, const std::string& owner) {
  if (stack.frames.size() != stack.sequence.frames.size()) {
    return Fail("{}: {} frames, but the pattern sequence has {}", owner, stack.frames.size(),
                stack.sequence.frames.size());
  }
  if (stack.frames.empty()) return Fail("{}: no frames", owner);
  const CapturedFrame& first = stack.frames.front();
  if (Width(first) < 1 || Height(first) < 1) return Fail("{}: frame 0 is empty", owner);
  for (std::size_t i = 0; i < stack.frames.size(); ++i) {
    const CapturedFrame& frame = stack.frames[i];
    if (Width(frame) != Width(first) || Height(frame) != Height(first)) {
      return Fail("{}: frame {} is {} x {}, but frame 0 is {} x {}", owner, i, Width(frame),
                  Height(frame), Width(first), Height(first));
    }
    if (frame.bit_depth != first.bit_depth || frame.pixels.index() != first.pixels.index()) {
      return Fail("{}: frame {} has {} bit, but frame 0 has {}", owner, i, frame.bit_depth,
                  first.bit_depth);
    }
    if (frame.bit_depth < 1 || frame.bit_depth > 16 ||
        (frame.pixels.index() == 0 && frame.bit_depth > 8)) {
      return Fail("{}: frame {} claims {} bit, must be 1..8 for bytes and 1..16 for words", owner,
                  i, frame.bit_depth);
    }
    if (i > 0 && frame.stamp_ns < stack.frames[i - 1].stamp_ns) {
      return Fail("{}: frame {} is stamped {} ns before frame {}", owner, i,
                  stack.frames[i - 1].stamp_ns - frame.stamp_ns, i - 1);
    }
  }
  if (stack.color &&
      (stack.color->width() != Width(first) || stack.color->height() != Height(first))) {
    return Fail("{}: the colour image is {} x {}, but the frames are {} x {}", owner,
                stack.color->width(), stack.color->height(), Width(first), Height(first));
  }
  return {};
}

}  // namespace fringe_fusion
