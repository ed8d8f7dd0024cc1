#pragma once

#include <fringe_fusion/CaptureFinding.h>

#include <vector>

#include "fringe_fusion/diagnosis/diagnose_stack.hpp"

namespace fringe_fusion::ros_io {

/// What was found in the capture of one view, in the order of the diagnosis.
[[nodiscard]] std::vector<CaptureFinding> ToMessages(const Diagnosis& diagnosis, int view_id);

}  // namespace fringe_fusion::ros_io
