#include "frame_rows.hpp"

#include <algorithm>
#include <cstddef>

namespace fringe_fusion::decode {

FrameRows::FrameRows(const ImageStack& stack, const DecodePlan& plan)
    : stack_(stack), plan_(plan), width_(Width(stack.frames.front())) {
  const auto width = static_cast<std::size_t>(width_);
  full_scale_dn_ = static_cast<float>((1 << stack.frames.front().bit_depth) - 1);
  values_.resize(stack.frames.size() * width);
  bright_.resize(width);
  dark_.resize(width);
}

void FrameRows::Load(int y) {
  const auto width = static_cast<std::size_t>(width_);
  for (std::size_t i = 0; i < stack_.frames.size(); ++i) {
    float* out = values_.data() + i * width;
    std::visit(
        [&](const auto& image) {
          const auto* in = image.row(y);
          for (std::size_t x = 0; x < width; ++x) out[x] = static_cast<float>(in[x]);
        },
        stack_.frames[i].pixels);
  }
  const auto extreme = [&](std::vector<float>& out, auto pick) {
    std::copy_n(values_.data(), width, out.begin());
    for (std::size_t i = 1; i < stack_.frames.size(); ++i) {
      const float* in = values_.data() + i * width;
      for (std::size_t x = 0; x < width; ++x) out[x] = pick(out[x], in[x]);
    }
  };
  if (plan_.white_frames.empty()) {
    extreme(bright_, [](float a, float b) { return a > b ? a : b; });
  } else {
    MeanOf(plan_.white_frames, bright_);
  }
  if (plan_.black_frames.empty()) {
    extreme(dark_, [](float a, float b) { return a < b ? a : b; });
  } else {
    MeanOf(plan_.black_frames, dark_);
  }
}

void FrameRows::MeanOf(const std::vector<int>& frames, std::vector<float>& out) const {
  std::fill(out.begin(), out.end(), 0.0F);
  const float share = 1.0F / static_cast<float>(frames.size());
  for (const int i : frames) {
    const float* in = frame(i);
    for (std::size_t x = 0; x < out.size(); ++x) out[x] += share * in[x];
  }
}

}  // namespace fringe_fusion::decode
