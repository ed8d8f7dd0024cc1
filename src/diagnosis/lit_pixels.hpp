#pragma once

#include "fringe_fusion/phase/phase_map.hpp"
#include "stack_sampling.hpp"

namespace fringe_fusion::diagnosis {

/// Brightest and darkest grey value that each sample takes in a stack: whatever the order of the
/// frames, the light with and without the projector, at the largest exposure.
struct LightRange {
  Image<float> dark;
  Image<float> bright;
  Image<std::uint8_t> lit;  ///< 1: the projector reaches the sample
  int num_lit = 0;
};

/// @param phase sensor noise, below which a range is none.
[[nodiscard]] LightRange FindLightRange(const SampledStack& stack, const PhaseConfig& phase);

/// sqrt(read^2 + gain I + 1/12) of a grey value I [DN].
[[nodiscard]] double NoiseSigma(const PhaseConfig& phase, double level_dn);

}  // namespace fringe_fusion::diagnosis
