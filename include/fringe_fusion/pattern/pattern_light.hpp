#pragma once

#include "fringe_fusion/common/image.hpp"
#include "fringe_fusion/pattern/pattern_sequence.hpp"

namespace fringe_fusion {

/// The light that a pattern wants everywhere, 0..1: what RenderPattern makes values of.
[[nodiscard]] Image<float> PatternLight(const Pattern& pattern, int width, int height);

}  // namespace fringe_fusion
