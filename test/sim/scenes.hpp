#pragma once

#include <stdexcept>
#include <utility>

#include "fringe_fusion/sim/gauges.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"

namespace fringe_fusion::sim {

/// The device with 1/divisor of its pixels per axis and the same field of view.
inline CameraModel Coarser(CameraModel model, int divisor) {
  model.width /= divisor;
  model.height /= divisor;
  model.fx /= divisor;
  model.fy /= divisor;
  // Pixel centres are at integers: the outer edge is at -1/2.
  model.cx = (model.cx + 0.5) / divisor - 0.5;
  model.cy = (model.cy + 0.5) / divisor - 0.5;
  return model;
}

/// Default scanner with few pixels, for quick tests.
inline CellCalibration SmallScanner(int divisor = 4) {
  CellCalibration calibration = DefaultCalibration();
  calibration.camera = Coarser(calibration.camera, divisor);
  calibration.projector = Coarser(calibration.projector, divisor);
  return calibration;
}

inline SimCell MakeCell(const SimConfig& config, const CellCalibration& calibration,
                        const Mesh& object, const Mesh& background = Mesh{}) {
  Result<SimCell> cell = SimCell::Create(config, calibration, object, background);
  if (!cell) throw std::runtime_error(cell.error().message);
  return std::move(*cell);
}

/// Looks straight down on the origin from 0.5 m: the camera's axis is -z of `object`.
inline Transform TopView() { return TurntablePose(0, 1, 0.5, 90.0, Eigen::Vector3d::Zero()); }

/// A picture of one grey value.
inline Image<std::uint8_t> Flat(const CellCalibration& calibration, std::uint8_t value) {
  return {calibration.projector.width, calibration.projector.height, value};
}

/// Pixels of one exposure at the reference time; throws where Expose fails.
inline FramePixels Shoot(SimCell& cell, const Image<std::uint8_t>& picture, int frame_index = 0) {
  Result<CapturedFrame> frame =
      cell.Expose(picture, cell.config().exposure_reference_s, frame_index);
  if (!frame) throw std::runtime_error(frame.error().message);
  return std::move(frame->pixels);
}

/// The same as doubles, whatever the bit depth [DN].
inline Image<double> ShootDn(SimCell& cell, const Image<std::uint8_t>& picture,
                             int frame_index = 0) {
  return std::visit(
      [](const auto& pixels) {
        Image<double> dn(pixels.width(), pixels.height());
        for (std::size_t i = 0; i < pixels.size(); ++i) dn[i] = static_cast<double>(pixels[i]);
        return dn;
      },
      Shoot(cell, picture, frame_index));
}

}  // namespace fringe_fusion::sim
