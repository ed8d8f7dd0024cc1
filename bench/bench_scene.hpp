#pragma once

#include <stdexcept>
#include <utility>

#include "fringe_fusion/sim/gauges.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"

namespace fringe_fusion::bench {

/// The default scanner with a camera of width x height pixels and the same field of view.
inline CellCalibration ScannerOfSize(int width, int height) {
  CellCalibration calibration = sim::DefaultCalibration();
  CameraModel& camera = calibration.camera;
  const double scale = static_cast<double>(width) / camera.width;
  camera.fx *= scale;
  camera.fy *= scale;
  camera.cx = (camera.cx + 0.5) * scale - 0.5;
  camera.cy = 0.5 * (height - 1);
  camera.width = width;
  camera.height = height;
  return calibration;
}

/// The freeform part on its plate before that scanner, at stop `view` of 12.
inline sim::SimCell MakeBenchCell(const sim::SimConfig& config, int width, int height, int view) {
  Result<sim::SimCell> cell = sim::SimCell::Create(
      config, ScannerOfSize(width, height), sim::MakeFreeform(6e-4), sim::MakePlate(0.07, 0.005));
  if (!cell) throw std::runtime_error(cell.error().message);
  const Transform T = sim::TurntablePose(view, 12, 0.5, 25.0, Eigen::Vector3d(0.0, 0.0, 0.035));
  if (const Status status = cell->MoveTo(T, view); !status) {
    throw std::runtime_error(status.error().message);
  }
  return std::move(*cell);
}

}  // namespace fringe_fusion::bench
