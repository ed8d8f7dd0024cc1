#pragma once

#include <cstdint>
#include <vector>

#include "frame_rows.hpp"

namespace fringe_fusion::decode {

/// What a phase set says about every pixel of a row.
struct SetRow {
  explicit SetRow(std::size_t size)
      : cycles(size), variance(size), offset(size), amplitude2(size), status(size) {}

  std::vector<float> cycles;         ///< phase / 2 pi, sign and offset undone, 0..1
  std::vector<float> variance;       ///< of cycles
  std::vector<float> offset;         ///< A [DN]
  std::vector<float> amplitude2;     ///< B^2 [DN^2]
  std::vector<std::int32_t> status;  ///< RowStatus

  [[nodiscard]] FitOut out() {
    return {cycles.data(), variance.data(), offset.data(), amplitude2.data(), status.data()};
  }
};

/// Weighted least-squares fit of I_n = exposure_n (A + B cos(phi - delta_n)) to every pixel of a
/// row, with the weights that the noise model gives at the fitted grey values. Attains the
/// Cramer-Rao bound of read, shot and quantisation noise. Saturated samples are dropped where three
/// different shifts remain. A carrier is demodulated first: only the direct light counts.
/// Ref: science sections 2.1, 2.7, 2.9. One object per thread: Run replaces the row.
class StepFit {
 public:
  StepFit(const PhaseSet& set, const DecodeContext& context);

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
};

}  // namespace fringe_fusion::decode
