#pragma once

#include <string>

#include "lit_pixels.hpp"
#include "stack_sampling.hpp"

namespace fringe_fusion::diagnosis {

/// What the sets of different frequencies say about each other.
struct FringeMeasures {
  std::string skipped;           ///< why there is nothing to compare; else empty
  double fine_contrast = 1.0;    ///< amplitude of the finest over the coarsest, lesser axis
  double fine_fringes = 0.0;     ///< of that axis
  std::string indirect_skipped;  ///< why the phases cannot be compared; else empty
  double indirect_rad = 0.0;     ///< disagreement of the coarsest phase with the finest, rms
};
[[nodiscard]] FringeMeasures MeasureFringes(const SampledStack& stack, const SequencePlan& plan,
                                            const LightRange& range);

}  // namespace fringe_fusion::diagnosis
