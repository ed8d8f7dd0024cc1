#pragma once

#include <fringe_fusion/PatternDescription.h>
#include <fringe_fusion/PatternList.h>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/pattern/pattern_sequence.hpp"

namespace fringe_fusion::ros_io {

[[nodiscard]] PatternDescription ToMessage(const Pattern& pattern);
/// @return error naming an unknown kind or axis.
[[nodiscard]] Result<Pattern> FromMessage(const PatternDescription& message);
[[nodiscard]] PatternList ToMessage(const PatternSequence& sequence);
/// @return error of an invalid sequence.
[[nodiscard]] Result<PatternSequence> FromMessage(const PatternList& message);

}  // namespace fringe_fusion::ros_io
