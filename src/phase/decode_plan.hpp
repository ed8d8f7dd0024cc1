#pragma once

#include <array>
#include <optional>
#include <vector>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/pattern/pattern_sequence.hpp"

namespace fringe_fusion::decode {

/// One complete N-step set: frame_of_step[n] is the frame of phase shift 2 pi n / N.
struct PhaseSet {
  double fringes = 0.0;
  double sign = 1.0;
  double offset_rad = 0.0;
  std::vector<int> frame_of_step;
};

/// Frames of one Gray bit; -1 where the sequence has none.
struct GrayBit {
  int frame = -1;
  int inverse_frame = -1;
};

/// Gray code of one axis: u = cell_px (code + 1/2) - 1/2 + offset_px.
struct GrayCode {
  int cell_px = 1;
  double offset_px = 0.0;
  std::vector<GrayBit> bits;  ///< index = bit, 0 is the finest
};

/// What a sequence says about one axis.
struct AxisPlan {
  int size_px = 0;
  std::optional<GrayCode> gray;
  std::vector<PhaseSet> sets;  ///< by rising number of fringes

  [[nodiscard]] bool IsCoded() const { return gray.has_value() || !sets.empty(); }
};

/// A sequence sorted by what its frames are for, whatever their order was.
struct DecodePlan {
  int num_frames = 0;
  std::vector<int> white_frames;
  std::vector<int> black_frames;
  AxisPlan u;
  AxisPlan v;
};

/// Sorts a sequence for decoding.
/// @return error when it is not valid, codes no axis, mixes parameters within one set or code, or
/// has fringes that nothing unwraps.
[[nodiscard]] Result<DecodePlan> MakeDecodePlan(const PatternSequence& sequence);

}  // namespace fringe_fusion::decode
