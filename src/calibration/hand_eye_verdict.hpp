#pragma once

#include "fringe_fusion/calibration/hand_eye.hpp"
#include "fringe_fusion/calibration/turntable_axis.hpp"

namespace fringe_fusion::internal {

/// Hold results against the limits, in words.
[[nodiscard]] Verdict JudgeHandEye(const HandEyeResult& result, const HandEyeConfig& config);
[[nodiscard]] Verdict JudgeTurntable(const TurntableResult& result, const TurntableConfig& config);

}  // namespace fringe_fusion::internal
