#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/calibrate_cell.hpp"
#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/calibration/target.hpp"

namespace fringe_fusion::test_support {

constexpr double kRadPerDeg = 3.14159265358979323846 / 180.0;

/// A cell that sees 300 x 300 x 80 mm about 0.7 m: camera of 5 Mpx, projector of 1280 x 800 with a
/// lens shift, 0.3 m apart.
[[nodiscard]] CellCalibration SceneCell();

[[nodiscard]] DeviceSizes SizesOf(const CellCalibration& cell);

/// 11 x 9 dots of 5 mm radius, 25 mm apart.
[[nodiscard]] CalibrationTarget SceneTarget();

struct SceneNoise {
  double sigma_camera_px = 0.03;
  double sigma_projector_px = 0.02;
  unsigned seed = 1;
  bool off = false;  ///< state the sigmas but add nothing
};

/// A pose whose target's middle lies at `middle`, tilted by `tilt_rad` about `axis_rad` in its
/// plane and rolled.
[[nodiscard]] Transform ScenePose(const CalibrationTarget& target, const Eigen::Vector3d& middle,
                                  double tilt_rad, double axis_rad, double roll_rad);

/// Poses over the volume: tilts of 10 to `max_tilt_deg` in all directions, some rolled.
[[nodiscard]] std::vector<Transform> ScenePoses(const CalibrationTarget& target, int num,
                                                unsigned seed, double max_tilt_deg = 30.0);

[[nodiscard]] bool InImage(const CameraModel& model, const Eigen::Vector2d& pixel);

/// Centre of area of a dot's image: its rim projected point by point, the lens included.
[[nodiscard]] Eigen::Vector2d CentreOfImage(const CameraModel& model,
                                            const Transform& T_camera_target,
                                            const Eigen::Vector3d& centre, double radius_m);

/// What both devices see of the target at one pose. Truth comes from the scene alone.
/// @param points true places of the points, which a bad print moves.
[[nodiscard]] TargetSighting Sight(const CellCalibration& cell, const CalibrationTarget& target,
                                   const std::vector<Eigen::Vector3d>& points, const Transform& T,
                                   const SceneNoise& noise, const std::string& name);

[[nodiscard]] std::vector<TargetSighting> SightAll(const CellCalibration& cell,
                                                   const CalibrationTarget& target,
                                                   const std::vector<Transform>& poses,
                                                   const SceneNoise& noise);

/// Parameters of a result minus those of the truth, in the order of CellCovariance.
[[nodiscard]] Eigen::VectorXd ParameterError(const CellCalibration& found,
                                             const CellCalibration& truth);

/// Squared error over the stated covariance per free parameter; 1 in the mean when it is true.
[[nodiscard]] double NormalizedError(const CellCalibrationResult& result,
                                     const CellCalibration& truth, int* dof);

}  // namespace fringe_fusion::test_support
