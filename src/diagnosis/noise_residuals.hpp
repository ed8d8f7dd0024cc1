#pragma once

#include <vector>

#include "fringe_fusion/diagnosis/sensor_noise.hpp"
#include "stack_sampling.hpp"

namespace fringe_fusion::diagnosis {

/// One measured variance and what it consists of:
/// E[variance] = constant (read^2 + quantisation^2) + level gain + b2 relative^2 of its group.
struct NoiseResidual {
  double variance_dn2 = 0.0;
  double dof = 1.0;
  double constant = 1.0;
  double level_dn = 0.0;
  double b2_dn2 = 0.0;
  int group = 0;
};

struct NoiseResiduals {
  std::vector<NoiseResidual> values;
  int num_groups = 0;
  std::vector<int> finest_groups;  ///< groups of the finest set of each axis
};

/// All variances that one scan offers: N-step residuals, white and black against the coarsest sets,
/// and mean levels of two sets where no set has residuals.
/// @param sigma_dn noise near grey value 0, for the distance from the ends of the scale.
[[nodiscard]] NoiseResiduals CollectNoiseResiduals(const SampledStack& stack,
                                                   const SequencePlan& plan,
                                                   const SensorNoise& guess);

}  // namespace fringe_fusion::diagnosis
