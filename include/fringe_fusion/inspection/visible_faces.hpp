#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion {

/// Marks the faces of a mesh that also belong to a part of it, by their exact corner positions.
/// @return one flag per face; error when the part is empty or has a face that the mesh lacks.
[[nodiscard]] Result<std::vector<std::uint8_t>> MarkFaces(const Mesh& mesh, const Mesh& part);

/// Reads which faces of a reference the cell could see: a mesh file that holds just those faces, or
/// a .txt file with one 0 or 1 per face of the reference.
/// @param unit_m size of one unit of a mesh file [m].
/// @return one flag per face; error naming the file, the count or the value that does not fit.
[[nodiscard]] Result<std::vector<std::uint8_t>> ReadVisibleFaces(const std::string& path,
                                                                 const Mesh& reference,
                                                                 double unit_m);

}  // namespace fringe_fusion
