#pragma once

#include "fringe_fusion/pattern/pattern_sequence.hpp"

namespace fringe_fusion {

/// Size of the projector along an axis [px].
inline int AxisSize(const PatternSequence& sequence, Axis axis) {
  return axis == Axis::kU ? sequence.width : sequence.height;
}

}  // namespace fringe_fusion
