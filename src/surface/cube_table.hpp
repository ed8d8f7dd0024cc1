#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace fringe_fusion::internal {

// Corner c of a cell lies at (c & 1, (c >> 1) & 1, c >> 2). Edge e runs along axis e / 4 from its
// lower corner.
constexpr int kCubeCorners = 8;
constexpr int kCubeEdges = 12;

struct CubeEdge {
  int axis = 0;
  int from = 0;  ///< corner with the smaller coordinate
  int to = 0;
};
[[nodiscard]] CubeEdge GetCubeEdge(int edge);

/// Triangles of each of the 256 sign patterns (bit c set: corner c is inside) as triples of edges,
/// counter-clockwise seen from outside.
///
/// The table is derived, not listed. On every face the surface's contour separates the inside
/// corners (where two lie on a diagonal each is cut off alone); this depends on the four signs of
/// the face only, so two cells agree about their common face. The contours are joined to closed
/// loops, and the loops are filled by triangles none of whose inner edges lies in a face of the
/// cell. Hence in the whole mesh each edge has at most two triangles.
class CubeTable {
 public:
  CubeTable();
  using Triangle = std::array<std::uint8_t, 3>;
  [[nodiscard]] const std::vector<Triangle>& operator[](unsigned pattern) const {
    return triangles_[pattern];
  }

 private:
  std::array<std::vector<Triangle>, 256> triangles_;
};

}  // namespace fringe_fusion::internal
