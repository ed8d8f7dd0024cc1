#pragma once

#include <string>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion::sim {

// Procedural parts with known dimensions, in metres, standing on z = 0 of `object` and centred on
// its z axis unless said otherwise. All closed and outward oriented except Plane.

/// Flat square, z = 0, normal +z.
[[nodiscard]] Mesh MakePlane(double side_m, int cells);
/// Sphere about `center`.
[[nodiscard]] Mesh MakeSphere(const Eigen::Vector3d& center, double radius_m, int subdivisions);
/// Two spheres `length_m` apart (centres) along x on a thin bar.
[[nodiscard]] Mesh MakeBallBar(double length_m, double radius_m);
/// Stairs of `steps` steps of `rise_m` each.
[[nodiscard]] Mesh MakeStepBlock(int steps, double rise_m, double run_m, double depth_m);
/// The demo part: a freeform body with through holes and thin ribs, about 80 mm.
[[nodiscard]] Mesh MakeFreeform(double resolution_m);
/// Thin round plate below z = 0: the turntable.
[[nodiscard]] Mesh MakePlate(double radius_m, double thickness_m);

/// By name: plane, sphere, ball_bar, step_block, freeform; or reads a mesh file.
[[nodiscard]] Result<Mesh> MakeObject(const std::string& name_or_path);

}  // namespace fringe_fusion::sim
