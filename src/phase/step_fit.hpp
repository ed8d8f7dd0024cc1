#pragma once

#include <vector>

#include "frame_rows.hpp"

namespace fringe_fusion::decode {

/// Least-squares fit of I_n = A + B cos(phi - 2 pi n / N) to every pixel of a row.
/// Ref: science section 2.1. One object per thread: Run replaces the row.
class StepFit {
 public:
  StepFit(const PhaseSet& set, int width);

  void Run(const FrameRows& rows);

  [[nodiscard]] const PhaseSet& set() const { return set_; }
  [[nodiscard]] float num_steps() const { return static_cast<float>(cos_.size()); }
  [[nodiscard]] float phase_rad(std::size_t x) const { return phase_[x]; }
  [[nodiscard]] float offset_dn(std::size_t x) const { return offset_[x]; }
  [[nodiscard]] float modulation_dn(std::size_t x) const { return modulation_[x]; }
  /// Sum of the squared residuals; it has N - 3 degrees of freedom [DN^2].
  [[nodiscard]] float residual_dn2(std::size_t x) const { return residual_[x]; }
  /// Largest grey value of the set [DN].
  [[nodiscard]] float peak_dn(std::size_t x) const { return peak_[x]; }

 private:
  void Accumulate(const FrameRows& rows);
  void SumResiduals(const FrameRows& rows);

  PhaseSet set_;
  std::vector<float> cos_;
  std::vector<float> sin_;
  std::vector<float> offset_;
  std::vector<float> cosine_part_;
  std::vector<float> sine_part_;
  std::vector<float> phase_;
  std::vector<float> modulation_;
  std::vector<float> residual_;
  std::vector<float> peak_;
};

}  // namespace fringe_fusion::decode
