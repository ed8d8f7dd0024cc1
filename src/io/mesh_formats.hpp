#pragma once

#include <cmath>
#include <string>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/surface/mesh.hpp"
#include "fringe_fusion/triangulation/range_image.hpp"

// One pair of functions per file format; mesh_io.cpp picks by extension and scales to metres.
namespace fringe_fusion::internal {

[[nodiscard]] Result<Mesh> ReadMeshPly(const std::string& path);
[[nodiscard]] Status WriteMeshPly(const Mesh& mesh, const std::string& path);

/// What a PLY mesh holds beside positions and corners.
struct PlyColumns {
  bool normals = false;
  bool colors = false;
  bool sigma = false;
  bool num_views = false;
  bool filled = false;
};
[[nodiscard]] PlyColumns ColumnsOf(const Mesh& mesh);
[[nodiscard]] std::string MeshPlyHeader(std::size_t num_vertices, std::size_t num_faces,
                                        const PlyColumns& columns);
/// Appends a vertex with its columns.
void PutPlyVertex(const Mesh& mesh, std::size_t i, std::string& bytes);

/// Corners of equal coordinates become one vertex; triangles that collapse by that are left out.
[[nodiscard]] Result<Mesh> ReadMeshStl(const std::string& path);
[[nodiscard]] Status WriteMeshStl(const Mesh& mesh, const std::string& path);

/// Positions, colours behind positions (`v x y z r g b`), normals and faces; the rest is ignored.
[[nodiscard]] Result<Mesh> ReadMeshObj(const std::string& path);
[[nodiscard]] Status WriteMeshObj(const Mesh& mesh, const std::string& path);

/// Binary glTF with normals, colours and `_SIGMA`; filled faces are a primitive of their own, with
/// extras.filled. Written only.
[[nodiscard]] Status WriteMeshGltf(const Mesh& mesh, const std::string& path);

/// Points that are not finite are left out, as organised clouds have them.
[[nodiscard]] Result<Mesh> ReadMeshPcd(const std::string& path);
[[nodiscard]] Status WriteMeshPcd(const Mesh& mesh, const std::string& path);

[[nodiscard]] Result<RangeImage> ReadRangePly(const std::string& path);
[[nodiscard]] Status WriteRangePly(const RangeImage& range, const std::string& path);
[[nodiscard]] Result<RangeImage> ReadRangePcd(const std::string& path);
[[nodiscard]] Status WriteRangePcd(const RangeImage& range, const std::string& path);

/// Appends the corners of a polygon as a fan of triangles.
/// @param corners vertex numbers. @return error naming a corner that is not in [0, num_vertices).
template <typename Corners>
[[nodiscard]] Status AppendPolygon(const Corners& corners, std::size_t num_vertices,
                                   const std::string& owner, std::vector<Eigen::Vector3i>& faces) {
  for (const auto corner : corners) {
    const auto number = static_cast<double>(corner);
    if (!(number >= 0.0 && number < static_cast<double>(num_vertices)) ||
        number != std::floor(number)) {
      return Fail("{}: vertex {} is outside [0, {})", owner, corner, num_vertices);
    }
  }
  if (corners.size() < 3) return Fail("{}: has {} corners, needs 3", owner, corners.size());
  for (std::size_t i = 2; i < corners.size(); ++i) {
    faces.emplace_back(static_cast<int>(corners[0]), static_cast<int>(corners[i - 1]),
                       static_cast<int>(corners[i]));
  }
  return {};
}

/// Colour of a range image whose file has none.
constexpr Rgb8 kPlainColor{180, 180, 180};

}  // namespace fringe_fusion::internal
