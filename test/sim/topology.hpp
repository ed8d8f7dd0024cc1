#pragma once

#include <Eigen/Geometry>
#include <map>
#include <utility>

#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion::sim {

struct MeshTopology {
  bool closed = false;  ///< every directed edge has exactly one partner in the other direction
  int euler = 0;        ///< vertices - edges + faces
};

inline MeshTopology Topology(const Mesh& mesh) {
  std::map<std::pair<int, int>, int> directed;
  for (const Eigen::Vector3i& face : mesh.faces) {
    for (int i = 0; i < 3; ++i) ++directed[{face[i], face[(i + 1) % 3]}];
  }
  MeshTopology topology;
  topology.closed = true;
  for (const auto& [edge, count] : directed) {
    const auto partner = directed.find({edge.second, edge.first});
    if (count != 1 || partner == directed.end()) topology.closed = false;
  }
  topology.euler = static_cast<int>(mesh.vertices.size()) - static_cast<int>(directed.size()) / 2 +
                   static_cast<int>(mesh.faces.size());
  return topology;
}

/// Signed volume: positive when a closed mesh is oriented outwards.
inline double Volume(const Mesh& mesh) {
  double volume = 0.0;
  for (const Eigen::Vector3i& face : mesh.faces) {
    const auto vertex = [&](int corner) -> Eigen::Vector3d {
      return mesh.vertices[static_cast<std::size_t>(face[corner])].cast<double>();
    };
    volume += vertex(0).dot(vertex(1).cross(vertex(2))) / 6.0;
  }
  return volume;
}

}  // namespace fringe_fusion::sim
