#pragma once

#include "fringe_fusion/phase/phase_correction.hpp"
#include "kernels.hpp"

namespace fringe_fusion::decode {

/// DecodePhase on one instruction set, or DecodeCorrectedPhase.
[[nodiscard]] Result<PhaseMap> DecodeWith(const Kernels& kernels, const ImageStack& stack,
                                          const PhaseConfig& config, const Progress& progress,
                                          PhaseMap recycled,
                                          const PhaseCorrection* correction = nullptr);

}  // namespace fringe_fusion::decode
