#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "fringe_fusion/calibration/calibrate_cell.hpp"

namespace fringe_fusion {

/// What a measured point is measured with.
struct MeasurementNoise {
  double sigma_camera_px = 0.0;  ///< 0: the camera pixel is exact, as in a scan
  double sigma_projector_px = 0.05;
};

/// Covariance of a measured point [m^2], camera frame.
struct PointError {
  Eigen::Matrix3d calibration = Eigen::Matrix3d::Zero();  ///< from the parameters, systematic
  Eigen::Matrix3d random = Eigen::Matrix3d::Zero();       ///< from the noise of the point itself
};

/// How a triangulated point moves with the 24 parameters while its pixels stay [m per unit].
/// @return nothing for a point behind a device or without parallax.
[[nodiscard]] std::optional<Eigen::Matrix<double, 3, kNumCellParameters>> PointByParameters(
    const CellCalibration& calibration, const Eigen::Vector3d& point_camera,
    const MeasurementNoise& noise);

/// Predicted error of a point: calibration part G Sigma G^T and random part.
/// @return nothing for a point that one of the devices cannot see.
/// Ref: science 1.5.
[[nodiscard]] std::optional<PointError> PredictPointError(const CellCalibration& calibration,
                                                          const CellCovariance& covariance,
                                                          const Eigen::Vector3d& point_camera,
                                                          const MeasurementNoise& noise);

/// Best point for a pair of pixels: weighted least squares of the four coordinates.
/// @return nothing when the rays do not meet before both devices.
[[nodiscard]] std::optional<Eigen::Vector3d> TriangulatePixels(
    const CellCalibration& calibration, const Eigen::Vector2d& pixel_camera,
    const Eigen::Vector2d& pixel_projector, const MeasurementNoise& noise);

/// A box in the camera frame [m].
struct Volume {
  Eigen::Vector3d low = Eigen::Vector3d::Zero();
  Eigen::Vector3d high = Eigen::Vector3d::Zero();
};

/// Predicted errors on a grid over a volume, x running fastest.
struct ErrorField {
  Volume volume;
  Eigen::Vector3i num = Eigen::Vector3i::Zero();
  std::vector<std::optional<PointError>> errors;

  [[nodiscard]] Eigen::Vector3d Point(int x, int y, int z) const;
  [[nodiscard]] const std::optional<PointError>& At(int x, int y, int z) const;
  /// rms of the calibration part over the points seen, per axis [m].
  [[nodiscard]] Eigen::Vector3d RmsCalibration() const;
};

/// @param num points per axis, at least 1 each.
[[nodiscard]] ErrorField PredictErrorField(const CellCalibration& calibration,
                                           const CellCovariance& covariance, const Volume& volume,
                                           const Eigen::Vector3i& num,
                                           const MeasurementNoise& noise);

/// The box of all target points that took part.
[[nodiscard]] Volume CalibratedVolume(const CellCalibrationResult& result);

}  // namespace fringe_fusion
