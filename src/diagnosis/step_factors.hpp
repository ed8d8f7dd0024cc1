#pragma once

#include <Eigen/Core>
#include <vector>

#include "lit_pixels.hpp"

namespace fringe_fusion::diagnosis {

/// Samples that a fit over the whole stack may use, and their grey values in the frames of phase
/// sets, one column per frame.
struct StepSamples {
  std::vector<std::size_t> pixels;
  std::vector<int> frames;          ///< frame of each column
  std::vector<std::size_t> set_of;  ///< set of each column
  std::vector<double> shift_rad;    ///< phase shift of each column
  Eigen::MatrixXd values_dn;
  Eigen::VectorXd dark_dn;
};

/// Samples of one kind, at most max_pixels of them.
/// @param lit true: unsaturated and lit, like all their neighbours; false: not lit, like all their
/// neighbours, so that ambient light alone is seen.
[[nodiscard]] StepSamples SelectStepSamples(const SampledStack& stack, const SequencePlan& plan,
                                            const LightRange& range, bool lit,
                                            std::size_t max_pixels);

/// What the frames of a stack have in common beyond the pixels' own A (the same in all sets), B and
/// phase: factors that change from frame to frame. Either kind is fitted alone, as the explanation
/// of all residuals.
struct FrameFactors {
  double gain_rms = 0.0;     ///< of the projector's light [ratio]
  double ambient_rms = 0.0;  ///< of the other light [of the projector's mean light]
  double gain_energy = 0.0;  ///< share of the squared residuals that it explains
  double ambient_energy = 0.0;
};

/// @param lit, unlit samples of one stack. @param sets that are looked at: those of few fringes do
/// not see the part move. With one set of N < 4 steps there is nothing to see.
[[nodiscard]] FrameFactors FitFrameFactors(const StepSamples& lit, const StepSamples& unlit,
                                           const std::vector<std::size_t>& sets);

}  // namespace fringe_fusion::diagnosis
