#pragma once

#include "findings.hpp"
#include "lit_pixels.hpp"

namespace fringe_fusion::diagnosis {

/// Median of the lit pixels' range of grey values over full scale; 0 when none is lit.
[[nodiscard]] double MedianLight(const SampledStack& stack, const LightRange& range);

/// Saturation and too little light. With several exposures the shortest must not saturate and the
/// longest must see enough.
/// @param shortest, longest of the frames of those exposures; the same stack when there is one.
void CheckLight(const SampledStack& shortest, const SampledStack& longest, const PhaseConfig& phase,
                const DiagnosisConfig& config, Findings& findings);

}  // namespace fringe_fusion::diagnosis
