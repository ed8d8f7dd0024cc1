#pragma once

#include "findings.hpp"
#include "lit_pixels.hpp"

namespace fringe_fusion::diagnosis {

/// Saturation and too little light.
void CheckLight(const SampledStack& stack, const LightRange& range, const PhaseConfig& phase,
                const DiagnosisConfig& config, Findings& findings);

}  // namespace fringe_fusion::diagnosis
