#pragma once

#include <functional>
#include <string>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion {

/// Reports how far a long computation is and asks whether to go on.
/// @param stage what is being done, e.g. "integrate".
/// @param fraction 0..1 of this stage.
/// @return false to cancel: the callee then returns Fail("cancelled ...") and leaves no half
/// result.
using Progress = std::function<bool(const std::string& stage, double fraction)>;

/// The progress sink of callers that neither show nor cancel.
inline bool NoProgress(const std::string& /*stage*/, double /*fraction*/) { return true; }

/// Message of the error of a cancelled computation.
constexpr const char* kCancelled = "cancelled by the caller";

}  // namespace fringe_fusion
