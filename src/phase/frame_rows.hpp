#pragma once

#include <vector>

#include "decode_plan.hpp"
#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/phase/phase_map.hpp"
#include "kernels.hpp"

namespace fringe_fusion {
struct PhaseCorrection;
}

namespace fringe_fusion::decode {

/// Noise of the camera as the kernels want it: read noise, shot noise and quantisation.
inline RowNoise NoiseOf(const PhaseConfig& config) {
  const auto read = static_cast<float>(config.read_noise_dn);
  return {read * read + 1.0F / 12.0F, static_cast<float>(config.gain_dn)};
}

/// Variance of one grey value: read noise, shot noise and quantisation [DN^2].
inline float NoiseVariance(const PhaseConfig& config, float mean_dn) {
  const RowNoise noise = NoiseOf(config);
  return noise.floor_dn2 + noise.gain_dn * mean_dn;
}

/// What the decoders of one stack share. Borrows; outlives none of its parts.
struct DecodeContext {
  const DecodePlan& plan;
  const PhaseConfig& config;
  const Kernels& kernels;
  int width = 0;  ///< of the stretch of a row that is decoded at once
  float full_scale_dn = 255.0F;
  const PhaseCorrection* correction = nullptr;  ///< null: phases are as measured

  /// Width of row buffers: whole blocks of the kernels.
  [[nodiscard]] std::size_t stride() const {
    return (static_cast<std::size_t>(width) + 63U) & ~63U;
  }
  [[nodiscard]] float saturation_dn() const {
    return static_cast<float>(config.saturation_ratio) * full_scale_dn;
  }
  /// When a fit of phases counts as good.
  [[nodiscard]] FitLimits limits() const;
};

/// Grey values of row y from column `begin` on, bytes or words.
[[nodiscard]] const void* PixelsOf(const CapturedFrame& frame, int y, int begin);

/// A stretch of one image row of all frames of a stack as float, and what a pixel looks like lit
/// and unlit. Borrows the stack. One object per thread: Load replaces the stretch.
class FrameRows {
 public:
  FrameRows(const ImageStack& stack, const DecodeContext& context);

  /// From column `begin` on; beyond the image the last pixel is repeated.
  void Load(int y, int begin = 0);

  [[nodiscard]] int width() const { return context_.width; }
  [[nodiscard]] const float* frame(int i) const {
    return values_.data() + static_cast<std::size_t>(i) * context_.stride();
  }
  /// Mean of the white frames of an exposure group, or the largest value of all its frames where
  /// there is none [DN].
  [[nodiscard]] const float* bright(int group) const {
    return bright_.data() + static_cast<std::size_t>(group) * context_.stride();
  }
  /// Mean of the black frames, or the least value of all frames where there is none [DN].
  [[nodiscard]] const float* dark(int group) const {
    return dark_.data() + static_cast<std::size_t>(group) * context_.stride();
  }

 private:
  void FindRange(std::size_t group);
  void MeanOf(const std::vector<int>& frames, float* out) const;

  const ImageStack& stack_;
  DecodeContext context_;
  std::vector<float> values_;
  std::vector<float> bright_;
  std::vector<float> dark_;
};

}  // namespace fringe_fusion::decode
