#pragma once

#include <vector>

#include "fringe_fusion/geometry/transform.hpp"

namespace fringe_fusion {

/// Metres per unit of a solution whose scale was open.
struct MetricScale {
  double scale = 0.0;
  double sigma = 0.0;  ///< standard deviation
};

/// Scale from one length that is known, e.g. of a ball bar or between dots of a plate.
/// @param estimated, sigma_estimated in units of the solution. @param true_m, sigma_m [m].
/// @return error when a length is not positive or a sigma negative. Ref: science 3.7 (2).
[[nodiscard]] Result<MetricScale> ScaleFromLength(double estimated, double sigma_estimated,
                                                  double true_m, double sigma_m);

/// One motion as the robot reports it and as the camera's poses show it: A X = X B.
struct MotionPair {
  Transform T_tool0_tool1 = Transform::Identity();      ///< A, metres
  Transform T_camera0_camera1 = Transform::Identity();  ///< B, translation in units of the solution
};

struct MotionScale {
  MetricScale scale;
  Transform T_tool_camera = Transform::Identity();  ///< X, metres
  double rms_m = 0.0;                               ///< residual of the translations
};

/// Scale and hand-eye transform from robot motions.
/// Rotation by Park and Martin; then the linear least squares (R_A - I) t_X - s R_X t_B = -t_A.
/// @param motions at least two whose rotation axes differ by more than 2 deg.
/// @return error when the axes are parallel (a turntable alone: its rotation tells no length; use a
/// known length or baseline), or the system is singular.
/// Ref: Park & Martin, "Robot sensor calibration: solving AX = XB", 1994; science 3.7 (3), 4.4.
[[nodiscard]] Result<MotionScale> ScaleFromMotion(const std::vector<MotionPair>& motions);

}  // namespace fringe_fusion
