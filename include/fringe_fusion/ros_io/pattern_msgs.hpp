#pragma once

#include <fringe_fusion/Pattern.h>
#include <fringe_fusion/PatternSequence.h>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/pattern/pattern_sequence.hpp"

namespace fringe_fusion::ros_io {

[[nodiscard]] fringe_fusion::Pattern FromMessage(const ::fringe_fusion::Pattern& pattern);

}  // namespace fringe_fusion::ros_io
