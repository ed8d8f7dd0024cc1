#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "fringe_fusion/common/image.hpp"

namespace fringe_fusion {

/// Indexed triangles. Vertex attributes are either empty or as long as `vertices`.
struct Mesh {
  std::vector<Eigen::Vector3f> vertices;  ///< [m]
  std::vector<Eigen::Vector3i> faces;     ///< counter-clockwise seen from outside
  std::vector<Eigen::Vector3f> normals;   ///< unit, outwards
  std::vector<Rgb8> colors;
  std::vector<float> sigma;                ///< standard deviation along the normal [m]
  std::vector<std::uint8_t> num_views;     ///< views that support the vertex
  std::vector<std::uint8_t> filled_faces;  ///< per face: 1 closes a hole instead of measuring
};

/// Area-weighted vertex normals.
[[nodiscard]] std::vector<Eigen::Vector3f> ComputeNormals(const Mesh& mesh);

/// Total area [m^2].
[[nodiscard]] double Area(const Mesh& mesh);

/// Diagonal of the box around all vertices, parallel to the axes [m]; 0 without vertices.
[[nodiscard]] double BoxDiagonal(const Mesh& mesh);

}  // namespace fringe_fusion
