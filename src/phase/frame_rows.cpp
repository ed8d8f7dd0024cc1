#include "frame_rows.hpp"

#include <algorithm>
#include <cstddef>
#include <type_traits>

namespace fringe_fusion::decode {

FrameRows::FrameRows(const ImageStack& stack, const DecodeContext& context)
    : stack_(stack), context_(context) {
  values_.resize(stack.frames.size() * context.stride());
  bright_.resize(context.plan.groups.size() * context.stride());
  dark_.resize(context.plan.groups.size() * context.stride());
}

void FrameRows::Load(int y) {
  const Kernels& kernels = context_.kernels;
  for (std::size_t i = 0; i < stack_.frames.size(); ++i) {
    float* out = values_.data() + i * context_.stride();
    const FramePixels& pixels = stack_.frames[i].pixels;
    if (const auto* bytes = std::get_if<Image<std::uint8_t>>(&pixels)) {
      kernels.bytes_to_float(bytes->row(y), out, context_.width);
    } else {
      kernels.words_to_float(std::get<Image<std::uint16_t>>(pixels).row(y), out, context_.width);
    }
  }
  for (std::size_t group = 0; group < context_.plan.groups.size(); ++group) FindRange(group);
}

void FrameRows::FindRange(std::size_t group) {
  const ExposureGroup& exposure = context_.plan.groups[group];
  float* high = bright_.data() + group * context_.stride();
  float* low = dark_.data() + group * context_.stride();
  if (exposure.white_frames.empty() || exposure.black_frames.empty()) {
    const float* first = frame(exposure.frames.front());
    std::copy_n(first, context_.width, high);
    std::copy_n(first, context_.width, low);
    for (const int i : exposure.frames) {
      context_.kernels.extend_range(frame(i), low, high, context_.width);
    }
  }
  if (!exposure.white_frames.empty()) MeanOf(exposure.white_frames, high);
  if (!exposure.black_frames.empty()) MeanOf(exposure.black_frames, low);
}

void FrameRows::MeanOf(const std::vector<int>& frames, float* out) const {
  const auto width = static_cast<std::size_t>(context_.width);
  std::fill_n(out, width, 0.0F);
  const float share = 1.0F / static_cast<float>(frames.size());
  for (const int i : frames) {
    const float* in = frame(i);
    for (std::size_t x = 0; x < width; ++x) out[x] += share * in[x];
  }
}

}  // namespace fringe_fusion::decode
