#pragma once

#include <string>
#include <vector>

#include "edge_shift.hpp"
#include "findings.hpp"
#include "step_factors.hpp"

namespace fringe_fusion::diagnosis {

/// What the residuals of all phase sets say about the response and about changes in time.
struct TimeMeasures {
  std::string response_skipped;  ///< why there is no gamma; else empty
  double gamma = 1.0;
  double harmonic = 0.0;  ///< second harmonic over the first
  std::string factors_skipped;
  FrameFactors factors;
  std::string motion_skipped;
  double phase_shift_rad = 0.0;  ///< of single steps of the finest fringes, rms
  EdgeShift edge_shift;
};

[[nodiscard]] TimeMeasures MeasureTime(const SampledStack& stack, const SequencePlan& plan,
                                       const LightRange& range, const Image<float>& mean_image);

/// Response, exposure, flicker and motion.
void CheckTime(const TimeMeasures& measures, const DiagnosisConfig& config, Findings& findings);

}  // namespace fringe_fusion::diagnosis
