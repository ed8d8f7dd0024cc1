#pragma once

#include <optional>
#include <vector>

#include "corrected_fit.hpp"
#include "set_row.hpp"

namespace fringe_fusion::decode {

/// Weighted least-squares fit of I_n = exposure_n (A + B cos(phi - delta_n)) to every pixel of a
/// row, with the weights that the noise model gives at the fitted grey values. Attains the
/// Cramer-Rao bound of read, shot and quantisation noise. Saturated samples are dropped where three
/// different shifts remain. A carrier is demodulated first: only the direct light counts.
/// Ref: science sections 2.1, 2.7, 2.9. One object per thread: Run replaces the row.
class StepFit {
 public:
  /// @param lut by which phases are corrected, or null; then CorrectedFit does the work.
  StepFit(const PhaseSet& set, const DecodeContext& context, const PhaseLut* lut = nullptr);

  void Run(const FrameRows& rows);

  [[nodiscard]] const PhaseSet& set() const { return set_; }
  [[nodiscard]] const SetRow& row() const { return row_; }

 private:
  [[nodiscard]] FitArgs Args() const;
  void RunEven(const FitArgs& args);
  void RefitSaturated(const FitArgs& args);
  void DemodulatePixel(std::size_t x);

  PhaseSet set_;
  DecodeContext context_;
  std::vector<const float*> frames_;
  std::vector<float> cosines_;
  std::vector<float> sines_;
  std::vector<float> exposures_;
  std::vector<int> places_;
  SetRow row_;
  SetRow refit_;
  std::optional<CorrectedFit> corrected_;
};

}  // namespace fringe_fusion::decode
