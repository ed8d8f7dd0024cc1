#pragma once

#include <string>

#include "fringe_fusion/geometry/transform.hpp"
#include "fringe_fusion/triangulation/range_image.hpp"

namespace fringe_fusion {

/// Where a pose came from.
enum class PoseSource { kNone, kFile, kTf, kEpipolar, kRegistration };
[[nodiscard]] const char* PoseSourceName(PoseSource source);

/// A pose with the covariance of its right perturbation T Exp(xi), order rotation, translation.
struct Pose {
  Transform T_object_camera = Transform::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< [rad^2, rad m, m^2]; zero: taken as exact
  PoseSource source = PoseSource::kNone;
};

/// A range image and where it was taken from.
struct View {
  int id = 0;
  std::string name;  ///< e.g. "003" or "bun045.ply"
  RangeImage range;
  Pose pose;
};

/// Diagonal pose covariance from a rotation and a translation standard deviation per axis.
[[nodiscard]] Matrix6d PoseCovariance(double sigma_rotation_rad, double sigma_translation_m);

/// Checks that a view has points and a pose with finite values and a positive semidefinite
/// covariance. @return error naming the view.
[[nodiscard]] Status Validate(const View& view);

}  // namespace fringe_fusion
