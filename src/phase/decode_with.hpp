#pragma once

#include "fringe_fusion/phase/phase_map.hpp"
#include "kernels.hpp"

namespace fringe_fusion::decode {

/// DecodePhase on one instruction set, for tests and benchmarks.
[[nodiscard]] Result<PhaseMap> DecodeWith(const Kernels& kernels, const ImageStack& stack,
                                          const PhaseConfig& config, const Progress& progress,
                                          PhaseMap recycled);

}  // namespace fringe_fusion::decode
