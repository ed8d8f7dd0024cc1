#pragma once

#include <vector>

#include "decode_plan.hpp"
#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/phase/phase_map.hpp"

namespace fringe_fusion::decode {

/// Variance of one grey value: read noise, shot noise and quantisation [DN^2].
inline float NoiseVariance(const PhaseConfig& config, float mean_dn) {
  const float read = static_cast<float>(config.read_noise_dn);
  return read * read + static_cast<float>(config.gain_dn) * mean_dn + 1.0F / 12.0F;
}

/// One image row of all frames of a stack as float, and what a pixel looks like lit and unlit.
/// Borrows the stack. One object per thread: Load replaces the row.
class FrameRows {
 public:
  FrameRows(const ImageStack& stack, const DecodePlan& plan);

  void Load(int y);

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] float full_scale_dn() const { return full_scale_dn_; }
  [[nodiscard]] const float* frame(int i) const {
    return values_.data() + static_cast<std::size_t>(i) * static_cast<std::size_t>(width_);
  }
  /// Mean of the white frames, or the largest value of all frames where there is none [DN].
  [[nodiscard]] const float* bright() const { return bright_.data(); }
  /// Mean of the black frames, or the least value of all frames where there is none [DN].
  [[nodiscard]] const float* dark() const { return dark_.data(); }

 private:
  void MeanOf(const std::vector<int>& frames, std::vector<float>& out) const;

  const ImageStack& stack_;
  const DecodePlan& plan_;
  int width_ = 0;
  float full_scale_dn_ = 255.0F;
  std::vector<float> values_;
  std::vector<float> bright_;
  std::vector<float> dark_;
};

}  // namespace fringe_fusion::decode
