#pragma once

#include <fringe_fusion/SuggestSettings.h>

#include "fringe_fusion/diagnosis/capture_assistant.hpp"

namespace fringe_fusion::ros_io {

/// A proposal as the answer of a success, with one line for people as its message.
[[nodiscard]] SuggestSettings::Response ToMessage(const CaptureProposal& proposal);

}  // namespace fringe_fusion::ros_io
