#pragma once

#include <optional>

#include "findings.hpp"
#include "frame_order.hpp"
#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "lit_pixels.hpp"
#include "stack_sampling.hpp"

namespace fringe_fusion::diagnosis {

/// What the checks of the optics look at.
struct OpticsInput {
  const SampledStack& stack;
  const SequencePlan& plan;
  const PatternSequence& sequence;
  const LightRange& range;
  const Image<float>& mean_image;
  const FrameOrder& order;
  const std::optional<CellCalibration>& calibration;
};

/// Resolution, focus of both devices, interreflection. Faults of the light and motion feign
/// interreflection: after such findings it is not looked for.
void CheckOptics(const OpticsInput& input, const DiagnosisConfig& config, Findings& findings);

}  // namespace fringe_fusion::diagnosis
