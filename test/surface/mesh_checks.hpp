#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <set>
#include <utility>

#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion::testing {

struct EdgeCounts {
  int num_edges = 0;
  int num_boundary = 0;      ///< with one face
  int num_non_manifold = 0;  ///< with more than two faces, or two that disagree about direction
};

/// Counts edges by their faces; `Faces` is a range of triples of vertex identifiers.
template <typename Faces>
EdgeCounts CountEdges(const Faces& faces) {
  // Number of faces that run along an edge upwards and downwards.
  std::map<std::pair<long, long>, std::array<int, 2>> directions;
  for (const auto& face : faces) {
    for (int i = 0; i < 3; ++i) {
      const auto a = static_cast<long>(face[i]);
      const auto b = static_cast<long>(face[(i + 1) % 3]);
      ++directions[{std::min(a, b), std::max(a, b)}][a < b ? 0 : 1];
    }
  }
  EdgeCounts counts;
  for (const auto& [edge, count] : directions) {
    ++counts.num_edges;
    if (count[0] > 1 || count[1] > 1) ++counts.num_non_manifold;
    if (count[0] + count[1] == 1) ++counts.num_boundary;
  }
  return counts;
}

}  // namespace fringe_fusion::testing
