#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <utility>

#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion::test_support {

/// Axis-aligned box of 12 triangles, normals outwards.
inline Mesh Box(const Eigen::Vector3f& low, const Eigen::Vector3f& high) {
  Mesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.vertices.emplace_back((i & 1) != 0 ? high.x() : low.x(), (i & 2) != 0 ? high.y() : low.y(),
                               (i & 4) != 0 ? high.z() : low.z());
  }
  mesh.faces = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

/// Sphere about the origin from an octahedron whose faces are split `levels` times.
inline Mesh Sphere(float radius, int levels) {
  Mesh mesh;
  mesh.vertices = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  mesh.faces = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<int, int>, int> middles;
    const auto middle = [&](int a, int b) {
      const auto [found, is_new] =
          middles.emplace(std::minmax(a, b), static_cast<int>(mesh.vertices.size()));
      if (is_new) {
        mesh.vertices.push_back((mesh.vertices[static_cast<std::size_t>(a)] +
                                 mesh.vertices[static_cast<std::size_t>(b)])
                                    .normalized());
      }
      return found->second;
    };
    std::vector<Eigen::Vector3i> finer;
    for (const Eigen::Vector3i& f : mesh.faces) {
      const int ab = middle(f[0], f[1]);
      const int bc = middle(f[1], f[2]);
      const int ca = middle(f[2], f[0]);
      finer.insert(finer.end(), {{f[0], ab, ca}, {ab, f[1], bc}, {ca, bc, f[2]}, {ab, bc, ca}});
    }
    mesh.faces = finer;
  }
  for (Eigen::Vector3f& vertex : mesh.vertices) vertex *= radius;
  return mesh;
}

/// Square plate [0, size]^2 at height z of n x n cells, normals along +z.
inline Mesh Plate(float size, int n, float z) {
  Mesh mesh;
  for (int y = 0; y <= n; ++y) {
    for (int x = 0; x <= n; ++x) {
      mesh.vertices.emplace_back(size * static_cast<float>(x) / static_cast<float>(n),
                                 size * static_cast<float>(y) / static_cast<float>(n), z);
    }
  }
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      const int i = y * (n + 1) + x;
      mesh.faces.emplace_back(i, i + 1, i + n + 1);
      mesh.faces.emplace_back(i + 1, i + n + 2, i + n + 1);
    }
  }
  return mesh;
}

}  // namespace fringe_fusion::test_support
