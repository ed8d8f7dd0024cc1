#pragma once

#include <stdexcept>
#include <string>
#include <utility>

#include "test/sim/scenes.hpp"

namespace fringe_fusion::test {

inline PatternSequence MakePatterns(const CellCalibration& calibration, const std::string& fringes,
                                    int steps) {
  PatternConfig config;
  config.fringes = fringes;
  config.steps = steps;
  return MakeSequence(config, calibration.projector.width, calibration.projector.height).value();
}

/// The freeform part on its plate before a scanner with 1/divisor of the pixels per axis.
inline sim::SimCell MakePartCell(const sim::SimConfig& config, int divisor, int stop) {
  sim::SimCell cell = sim::MakeCell(config, sim::SmallScanner(divisor), sim::MakeFreeform(2e-3),
                                    sim::MakePlate(0.07, 0.005));
  const Transform T = sim::TurntablePose(stop, 12, 0.5, 25.0, Eigen::Vector3d(0.0, 0.0, 0.035));
  if (const Status status = cell.MoveTo(T, stop); !status) {
    throw std::runtime_error(status.error().message);
  }
  return cell;
}

inline ImageStack Capture(sim::SimCell& cell, const PatternSequence& sequence,
                          double pattern_gamma = 1.0) {
  Result<ImageStack> stack =
      sim::CaptureStack(cell, sequence, pattern_gamma, cell.config().exposure_reference_s, 0);
  if (!stack) throw std::runtime_error(stack.error().message);
  return std::move(*stack);
}

}  // namespace fringe_fusion::test
