#pragma once

#include "fringe_fusion/phase/phase_map.hpp"
#include "kernels.hpp"

namespace fringe_fusion::decode {

/// Masks (kEdge) pixels whose coordinates jump against both neighbours of a row or column, and
/// mixed pixels at object borders, whose B / A falls below the mean of the valid pixels of their 3
/// x 3 window. Ref: science section 2.6.
[[nodiscard]] PhaseMap MaskEdges(PhaseMap map, const PhaseConfig& config,
                                 const Kernels& kernels = BestKernels());

}  // namespace fringe_fusion::decode
