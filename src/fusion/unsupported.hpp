#pragma once

#include "common/constants.hpp"
#include "fringe_fusion/fusion/voxel_field.hpp"

namespace fringe_fusion::internal {

/// The field where nothing was measured.
inline FieldSample Unsupported() {
  FieldSample sample;
  sample.distance = sample.sigma = sample.weight = kNan;
  sample.gradient.setConstant(kNan);
  return sample;
}

}  // namespace fringe_fusion::internal
