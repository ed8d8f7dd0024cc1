#include "frame_rows.hpp"

#include <algorithm>
#include <cstddef>
#include <type_traits>

namespace fringe_fusion::decode {

FitLimits DecodeContext::limits() const {
  const auto square = [](double x) { return static_cast<float>(x * x); };
  FitLimits limits;
  limits.saturation_dn = saturation_dn();
  limits.min_modulation2 = square(config.min_modulation_sigma);
  limits.max_residual2 = square(config.max_residual_sigma);
  limits.harmonic2 = square(config.max_harmonic_ratio);
  return limits;
}

const void* PixelsOf(const CapturedFrame& frame, int y, int begin) {
  if (const auto* bytes = std::get_if<Image<std::uint8_t>>(&frame.pixels)) {
    return bytes->row(y) + begin;
  }
  return std::get<Image<std::uint16_t>>(frame.pixels).row(y) + begin;
}

FrameRows::FrameRows(const ImageStack& stack, const DecodeContext& context)
    : stack_(stack), context_(context) {
  values_.resize(stack.frames.size() * context.stride());
  bright_.resize(context.plan.groups.size() * context.stride());
  dark_.resize(context.plan.groups.size() * context.stride());
}

void FrameRows::Load(int y, int begin) {
  const Kernels& kernels = context_.kernels;
  const int count = std::min(context_.width, Width(stack_.frames.front()) - begin);
  for (std::size_t i = 0; i < stack_.frames.size(); ++i) {
    float* out = values_.data() + i * context_.stride();
    const FramePixels& pixels = stack_.frames[i].pixels;
    if (const auto* bytes = std::get_if<Image<std::uint8_t>>(&pixels)) {
      kernels.bytes_to_float(bytes->row(y) + begin, out, count);
    } else {
      kernels.words_to_float(std::get<Image<std::uint16_t>>(pixels).row(y) + begin, out, count);
    }
    std::fill(out + count, out + context_.width, out[count - 1]);
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
