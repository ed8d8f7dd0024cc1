#include "cube_table.hpp"

#include <algorithm>
#include <optional>
#include <stdexcept>

namespace fringe_fusion::internal {
namespace {

using Loop = std::vector<int>;
using Triangles = std::vector<CubeTable::Triangle>;

// The edge between two neighbouring corners.
int EdgeBetween(int a, int b) {
  for (int edge = 0; edge < kCubeEdges; ++edge) {
    const CubeEdge found = GetCubeEdge(edge);
    if (found.from == std::min(a, b) && found.to == std::max(a, b)) return edge;
  }
  throw std::logic_error("CubeTable: corners are not neighbours");
}

// Corners of a face, counter-clockwise seen from outside the cell. Face = 2 axis + side.
std::array<int, 4> FaceCorners(int face) {
  const int axis = face / 2;
  const int side = face % 2;
  const int u = 1 << ((axis + 1) % 3);
  const int v = 1 << ((axis + 2) % 3);
  const int base = side << axis;
  // u, v and the axis are right-handed, so this order is counter-clockwise seen from +axis.
  if (side == 1) return {base, base + u, base + u + v, base + v};
  return {base, base + v, base + u + v, base + u};
}

bool ShareFace(int edge_a, int edge_b) {
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2;
    const int side = face % 2;
    const auto on_face = [&](int edge) {
      const CubeEdge e = GetCubeEdge(edge);
      return ((e.from >> axis) & 1) == side && ((e.to >> axis) & 1) == side;
    };
    if (on_face(edge_a) && on_face(edge_b)) return true;
  }
  return false;
}

// next[e]: the edge at the end of the contour that starts on edge e in one of its faces; -1: edge e
// is not crossed. Walking a face counter-clockwise, each run of inside corners is cut off by a
// contour from the edge where the run begins to the edge where it ends; so the loop runs
// counter-clockwise seen from outside the surface.
std::array<int, kCubeEdges> Contours(unsigned pattern) {
  std::array<int, kCubeEdges> next{};
  next.fill(-1);
  const auto inside = [&](int corner) { return ((pattern >> corner) & 1U) != 0; };
  for (int face = 0; face < 6; ++face) {
    const std::array<int, 4> corners = FaceCorners(face);
    const auto corner = [&](std::size_t i) { return corners[i % 4]; };
    for (std::size_t i = 0; i < 4; ++i) {
      if (!inside(corner(i)) || inside(corner(i + 1))) continue;
      std::size_t first = i + 4;
      while (inside(corner(first - 1)) && first > i + 1) --first;
      const int begin = EdgeBetween(corner(first + 3), corner(first));
      next[static_cast<std::size_t>(begin)] = EdgeBetween(corner(i), corner(i + 1));
    }
  }
  return next;
}

std::vector<Loop> Loops(unsigned pattern) {
  const std::array<int, kCubeEdges> next = Contours(pattern);
  std::array<bool, kCubeEdges> visited{};
  std::vector<Loop> loops;
  for (int start = 0; start < kCubeEdges; ++start) {
    Loop loop;
    for (int edge = start; next[static_cast<std::size_t>(edge)] >= 0;
         edge = next[static_cast<std::size_t>(edge)]) {
      if (visited[static_cast<std::size_t>(edge)]) break;
      visited[static_cast<std::size_t>(edge)] = true;
      loop.push_back(edge);
    }
    if (!loop.empty()) loops.push_back(loop);
  }
  return loops;
}

// All triangulations of a loop are tried, ear after ear; the first without an inner edge in a face
// is taken.
std::optional<Triangles> Triangulate(const Loop& loop) {
  const auto triangle = [](int a, int b, int c) {
    return CubeTable::Triangle{static_cast<std::uint8_t>(a), static_cast<std::uint8_t>(b),
                               static_cast<std::uint8_t>(c)};
  };
  if (loop.size() == 3) return Triangles{triangle(loop[0], loop[1], loop[2])};
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const int before = loop[(i + loop.size() - 1) % loop.size()];
    const int after = loop[(i + 1) % loop.size()];
    if (ShareFace(before, after)) continue;
    Loop rest = loop;
    rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(i));
    std::optional<Triangles> triangles = Triangulate(rest);
    if (!triangles) continue;
    triangles->push_back(triangle(before, loop[i], after));
    return triangles;
  }
  return std::nullopt;
}

}  // namespace

CubeEdge GetCubeEdge(int edge) {
  const int axis = edge / 4;
  const int u = 1 << ((axis + 1) % 3);
  const int v = 1 << ((axis + 2) % 3);
  const int from = ((edge & 1) != 0 ? u : 0) + ((edge & 2) != 0 ? v : 0);
  return {axis, from, from + (1 << axis)};
}

CubeTable::CubeTable() {
  for (unsigned pattern = 0; pattern < triangles_.size(); ++pattern) {
    for (const Loop& loop : Loops(pattern)) {
      const std::optional<Triangles> triangles = Triangulate(loop);
      if (!triangles) throw std::logic_error("CubeTable: a loop cannot be filled");
      triangles_[pattern].insert(triangles_[pattern].end(), triangles->begin(), triangles->end());
    }
  }
}

}  // namespace fringe_fusion::internal
