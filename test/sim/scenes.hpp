#pragma once

#include <gtest/gtest.h>

#include <utility>

#include "fringe_fusion/sim/gauges.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"

namespace fringe_fusion::sim {

/// Cell with the default devices, or throws with the reason.
inline SimCell MakeCell(const SimConfig& config, const Mesh& object,
                        const Mesh& background = Mesh{},
                        const CellCalibration& calibration = DefaultCalibration()) {
  Result<SimCell> cell = SimCell::Create(config, calibration, object, background);
  if (!cell) throw std::runtime_error(cell.error().message);
  return std::move(*cell);
}

/// Looks straight down on the origin from 0.5 m: the camera's axis is -z of `object`.
inline Transform TopView() { return TurntablePose(0, 1, 0.5, 90.0, Eigen::Vector3d::Zero()); }

/// A picture of one grey value.
inline Image<std::uint8_t> Flat(std::uint8_t value) {
  const CellCalibration calibration = DefaultCalibration();
  return {calibration.projector.width, calibration.projector.height, value};
}

}  // namespace fringe_fusion::sim
