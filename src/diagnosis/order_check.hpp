#pragma once

#include "findings.hpp"
#include "frame_order.hpp"

namespace fringe_fusion::diagnosis {

/// Missing, repeated, late and swapped frames.
/// @param whole stack, whose frames are counted. @param stack its frames of one exposure that can
/// be compared, `sampled` the same. @param is_dark too little light to compare frames.
/// @return the comparison, whose coordinates other checks use.
FrameOrder CheckFrames(const ImageStack& whole, const ImageStack& stack,
                       const SampledStack& sampled, const PhaseConfig& phase, bool is_dark,
                       Findings& findings);

}  // namespace fringe_fusion::diagnosis
