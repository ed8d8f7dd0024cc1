#pragma once

#include "fringe_fusion/calibration/target_print.hpp"
#include "fringe_fusion/geometry/transform.hpp"
#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion::sim {

/// A print on the object: its lightness multiplies the albedo where the plane z = 0 of the target
/// lies, within a tenth of a millimetre.
struct SurfacePrint {
  TargetPrint print;
  Transform T_object_target = Transform::Identity();
  double softness_m = 0.0;  ///< Gaussian sigma of its edges: ink spreads; 0: sharp
};

/// The ground of a target as two triangles that face -z of the target, where a camera looks at it.
[[nodiscard]] Mesh MakeTargetPlate(const SurfacePrint& print);

/// Pose of the camera before a target: at `distance_m` from its middle, the target turned about
/// its own y and x axes by the tilts and about the line of sight by `roll_rad`.
[[nodiscard]] Transform TargetView(const TargetPrint& print, double distance_m, double tilt_y_rad,
                                   double tilt_x_rad, double roll_rad);

}  // namespace fringe_fusion::sim
