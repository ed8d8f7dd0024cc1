#pragma once

#include <optional>
#include <vector>

#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/pattern/pattern_sequence.hpp"

namespace fringe_fusion::decode {

/// One frame of a phase set: I = A + B cos(sign (2 pi f X + offset) - delta).
struct PhaseSample {
  int frame = -1;
  double delta_rad = 0.0;
  int step = 0;
  int carrier_step = 0;
  int group = 0;  ///< exposure group
};

/// All frames of one frequency on one axis, by group, step and carrier step.
struct PhaseSet {
  double fringes = 0.0;
  double sign = 1.0;
  double offset_rad = 0.0;
  int steps = 0;
  int carrier_steps = 0;  ///< 0: no carrier
  bool even = true;       ///< delta = 2 pi step / steps, one exposure
  std::vector<PhaseSample> samples;
};

/// Frames of one Gray bit at one exposure; -1 where the sequence has none.
struct GrayRead {
  int frame = -1;
  int inverse_frame = -1;
  int group = 0;
};

struct GrayBit {
  std::vector<GrayRead> reads;
};

/// Gray code of one axis: u = cell_px (code + 1/2) - 1/2 + offset_px.
struct GrayCode {
  double cell_px = 1.0;
  double offset_px = 0.0;
  std::vector<GrayBit> bits;  ///< index = bit, 0 is the finest
};

/// One frame of micro phase shifting: I = A + B cos(2 pi fringes X + psi).
struct MicroSample {
  int frame = -1;
  double fringes = 0.0;
  double psi_rad = 0.0;
  int group = 0;
};

/// How the orders of the fringes are found.
enum class Unwrapping {
  kNested,    ///< from coarse to fine, starting at one fringe or at the Gray code
  kJoint,     ///< all frequencies at once: heterodyne, coprime periods
  kRelative,  ///< one frequency: over the image
};

/// What a sequence says about one axis.
struct AxisPlan {
  int size_px = 0;
  std::optional<GrayCode> gray;
  std::vector<PhaseSet> sets;      ///< by rising number of fringes
  std::vector<MicroSample> micro;  ///< stands alone
  Unwrapping unwrapping = Unwrapping::kNested;

  [[nodiscard]] bool IsCoded() const { return gray.has_value() || !sets.empty() || !micro.empty(); }
  [[nodiscard]] bool IsGrayAlone() const { return gray.has_value() && sets.empty(); }
};

/// Frames of one exposure.
struct ExposureGroup {
  double ratio = 1.0;  ///< exposure over that of the reference group
  std::vector<int> frames;
  std::vector<int> white_frames;
  std::vector<int> black_frames;
};

/// A sequence sorted by what its frames are for, whatever their order was.
struct DecodePlan {
  int num_frames = 0;
  std::vector<ExposureGroup> groups;  ///< by rising ratio
  int reference_group = 0;            ///< the one nearest to the exposure of the scan
  AxisPlan u;
  AxisPlan v;
};

/// Sorts a sequence for decoding.
/// @param exposures relative exposure of every frame; empty: the exposure ratios of the patterns.
/// @return error when it is not valid, codes no axis, or mixes parameters within one set or code.
[[nodiscard]] Result<DecodePlan> MakeDecodePlan(const PatternSequence& sequence,
                                                const std::vector<double>& exposures = {});

/// Relative exposures as they were taken: exposure times gain, over that of the first frame whose
/// pattern has the ratio nearest to 1. Empty when the stack does not state them.
[[nodiscard]] std::vector<double> TakenExposures(const ImageStack& stack);

}  // namespace fringe_fusion::decode
