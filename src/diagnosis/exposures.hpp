#pragma once

#include <set>

#include "fringe_fusion/phase/phase_map.hpp"
#include "stack_sampling.hpp"

namespace fringe_fusion::diagnosis {

/// Whether all frames have one exposure and each codes one coordinate.
[[nodiscard]] bool IsOneExposure(const PatternSequence& sequence);

/// The exposure ratios of a stack.
[[nodiscard]] std::set<double> ExposuresOf(const ImageStack& stack);

/// Frames of one exposure, each of which codes one coordinate; of a stack of carriers alone one
/// frame, by which nothing can be measured.
[[nodiscard]] ImageStack OneExposure(const ImageStack& stack, double exposure_ratio);

/// Samples of the frames of one exposure, of all kinds; all where there is none.
[[nodiscard]] SampledStack FramesOf(const SampledStack& sampled, const PatternSequence& sequence,
                                    double exposure_ratio);

/// The exposure that leaves most pixels lit and unsaturated.
/// @param sampled of the stack. @param phase sensor noise and saturation.
[[nodiscard]] double BestExposure(const SampledStack& sampled, const ImageStack& stack,
                                  const PhaseConfig& phase);

}  // namespace fringe_fusion::diagnosis
