#pragma once

#include <vector>

#include "joint_unwrap.hpp"

namespace fringe_fusion::decode {

/// Micro phase shifting: near-equal high frequencies see the same indirect light, so offset and
/// amplitude are common and one frame per frequency is enough. Every order of the frequency with
/// three steps is a candidate for the coordinate; the best ones are refined together with offset
/// and amplitude by weighted least squares over all frames. Ref: Gupta & Nayar, "Micro Phase
/// Shifting", CVPR 2012. One object per thread.
class MicroFit {
 public:
  MicroFit(const AxisPlan& plan, const DecodeContext& context);

  void Load(const FrameRows& rows);
  [[nodiscard]] Unwrapped Run(std::size_t x);
  /// Of the last pixel [DN].
  [[nodiscard]] double offset_dn() const { return offset_dn_; }
  [[nodiscard]] double modulation_dn() const { return modulation_dn_; }

 private:
  struct Sample {
    const float* row = nullptr;
    double fringes = 0.0;
    double psi_rad = 0.0;
    double exposure = 1.0;
    double grey = 0.0;
    double weight = 0.0;
  };
  struct Fitted {
    double ratio = 0.0;  ///< coordinate as a share of the axis
    double offset = 0.0;
    double amplitude = 0.0;
    double chi2 = 0.0;
    double variance = 0.0;  ///< of ratio
  };

  bool ReadPixel(std::size_t x);
  [[nodiscard]] bool FitReference(Fitted& out) const;
  [[nodiscard]] double CostOf(const Fitted& fitted, double ratio) const;
  [[nodiscard]] Fitted Refine(Fitted start) const;
  [[nodiscard]] Unwrapped Judge(const std::vector<Fitted>& refined);

  const AxisPlan& plan_;
  DecodeContext context_;
  double reference_fringes_ = 0.0;
  std::vector<int> frames_;
  std::vector<Sample> samples_;
  std::vector<Sample> used_;
  double offset_dn_ = 0.0;
  double modulation_dn_ = 0.0;
};

}  // namespace fringe_fusion::decode
