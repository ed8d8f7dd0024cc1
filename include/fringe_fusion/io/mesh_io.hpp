#pragma once

#include <string>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/surface/mesh.hpp"
#include "fringe_fusion/triangulation/range_image.hpp"

namespace fringe_fusion {

/// Reads a mesh or cloud by its extension: .ply (ASCII or binary), .stl, .obj, .pcd (points only).
/// @param unit_m size of one file unit [m], 1 for metres, 0.001 for millimetres.
/// @return error naming the file and what is wrong (missing, lying header, index out of range,
/// NaN).
[[nodiscard]] Result<Mesh> ReadMesh(const std::string& path, double unit_m = 1.0);

/// Writes by extension: .ply (binary with every attribute), .stl (binary), .obj, .glb (binary
/// glTF), .pcd. Atomic.
[[nodiscard]] Status WriteMesh(const Mesh& mesh, const std::string& path);

/// Reads an organised cloud: PLY with `obj_info num_cols/num_rows` and `range_grid` (ours, and the
/// Stanford scans), or an organised PCD. Without normals in the file they are left NaN.
[[nodiscard]] Result<RangeImage> ReadRangeImage(const std::string& path);

/// Writes range.ply: binary float x y z nx ny nz, uchar red green blue, float sigma_range
/// sigma_lateral; `range_grid`; no NaN. Or a .pcd (organised, NaN where invalid). Atomic.
[[nodiscard]] Status WriteRangeImage(const RangeImage& range, const std::string& path);

/// All valid points of a range image as a mesh without faces.
[[nodiscard]] Mesh ToCloud(const RangeImage& range);

}  // namespace fringe_fusion
