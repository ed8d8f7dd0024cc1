#pragma once

#include "fringe_fusion/phase/phase_map.hpp"

namespace fringe_fusion::decode {

/// Masks (kEdge) pixels whose coordinates jump against both neighbours of a row or column, and
/// mixed pixels at object borders, whose B / A falls below that of their surroundings.
/// Ref: science section 2.6.
[[nodiscard]] PhaseMap MaskEdges(PhaseMap map, const PhaseConfig& config);

}  // namespace fringe_fusion::decode
