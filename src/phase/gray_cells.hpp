#pragma once

#include "decode_plan.hpp"
#include "fringe_fusion/phase/phase_map.hpp"

namespace fringe_fusion::decode {

/// Takes the rounding out of a map of two Gray codes: a projector cell is seen by a connected group
/// of camera pixels, and its centre by the centre of that group. The pixel nearest to it keeps the
/// cell, moved to the pixel's own centre by the local slope; the others are masked (kMerged). What
/// remains has one independent measurement per cell. Pixels whose finest bits are doubtful have no
/// cell (kDoubtfulOrder).
[[nodiscard]] PhaseMap KeepOnePixelPerCell(PhaseMap map, const GrayCode& code_u,
                                           const GrayCode& code_v, const PhaseConfig& config);

}  // namespace fringe_fusion::decode
