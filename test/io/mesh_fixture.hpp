#pragma once

#include <cmath>

#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion::test_support {

/// A tetrahedron with awkward coordinates and every attribute.
inline Mesh FullTetrahedron() {
  Mesh mesh;
  mesh.vertices = {{0.1F, 0.2F, 1.0F / 3.0F}, {1.0F, -1e-7F, 0.0F}, {0.0F, 2.0F, 1e6F}, {0, 0, -3}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};
  mesh.normals = {{0, 0, 1}, {0.6F, 0.8F, 0}, {0, 1, 0}, {0, 0, -1}};
  mesh.colors = {{1, 2, 3}, {255, 0, 128}, {9, 9, 9}, {0, 255, 0}};
  mesh.sigma = {1e-5F, 2e-5F, 1.0F / 3.0F, 4e-5F};
  mesh.num_views = {1, 2, 3, 255};
  mesh.filled_faces = {0, 1, 0, 1};
  return mesh;
}

inline bool SameColors(const Mesh& a, const Mesh& b) {
  if (a.colors.size() != b.colors.size()) return false;
  for (std::size_t i = 0; i < a.colors.size(); ++i) {
    if (a.colors[i].r != b.colors[i].r || a.colors[i].g != b.colors[i].g ||
        a.colors[i].b != b.colors[i].b) {
      return false;
    }
  }
  return true;
}

}  // namespace fringe_fusion::test_support
