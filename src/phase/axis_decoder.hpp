#pragma once

#include <optional>
#include <vector>

#include "gray_fit.hpp"
#include "step_fit.hpp"

namespace fringe_fusion::decode {

/// One decoded coordinate of one pixel.
struct AxisPixel {
  float coordinate_px = 0.0F;  ///< NaN unless reason is kValid
  float sigma_px = 0.0F;
  float offset_dn = 0.0F;
  float modulation_dn = 0.0F;
  MaskReason reason = MaskReason::kValid;
};

/// Decodes one axis row by row: fits every phase set, reads the Gray code, unwraps from coarse to
/// fine and fuses all phase sets by inverse variance. One object per thread.
/// Ref: science sections 2.1, 2.3, 2.4.
class AxisDecoder {
 public:
  AxisDecoder(const AxisPlan& plan, const PhaseConfig& config, int width);

  void Run(const FrameRows& rows);
  /// @param full_scale_dn largest grey value of the stack.
  [[nodiscard]] AxisPixel Decode(std::size_t x, float full_scale_dn) const;

 private:
  struct Estimate {
    double coordinate_px = 0.0;
    double half_px = 0.0;       ///< half of the interval that the Gray code leaves open
    double information = 0.0;   ///< 1 / variance of the fused phases [1/px^2]
    double weighted_sum = 0.0;  ///< sum of information times coordinate
  };

  [[nodiscard]] MaskReason CheckSets(std::size_t x, float full_scale_dn) const;
  [[nodiscard]] AxisPixel DecodeGray(std::size_t x) const;
  [[nodiscard]] AxisPixel DecodePhases(std::size_t x) const;
  [[nodiscard]] bool AddSet(const StepFit& fit, std::size_t x, Estimate& estimate) const;
  [[nodiscard]] double WrapIntoProjector(double coordinate_px) const;

  AxisPlan plan_;
  PhaseConfig config_;
  bool repeats_over_size_ = false;  ///< every phase repeats after exactly one projector size
  std::optional<GrayFit> gray_;
  std::vector<StepFit> fits_;
};

}  // namespace fringe_fusion::decode
