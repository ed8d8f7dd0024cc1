#pragma once

#include <string>

#include "fringe_fusion/geometry/camera_model.hpp"
#include "fringe_fusion/geometry/transform.hpp"

namespace fringe_fusion {

/// Everything a scan needs to know about the two devices of a scanner. File: cell.yaml.
struct CellCalibration {
  CameraModel camera;
  CameraModel projector;
  Transform T_projector_camera = Transform::Identity();
  std::string camera_serial;     ///< empty: not bound to a device
  std::string projector_serial;  ///< empty: not bound to a device
  std::string date;              ///< ISO 8601, empty if unknown
  double rms_px = 0.0;           ///< joint reprojection rms, 0 if unknown
};

/// Checks both devices and that the baseline is finite and not zero.
[[nodiscard]] Status Validate(const CellCalibration& calibration, const std::string& owner);

/// Short hexadecimal fingerprint of the geometry: both devices, and their pose to 1 nm. Every
/// product carries it. The same whether read from cell.yaml or from CameraInfo and tf, which know
/// no serials.
[[nodiscard]] std::string CalibrationId(const CellCalibration& calibration);

}  // namespace fringe_fusion
