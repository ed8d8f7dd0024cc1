#include "src/surface/cube_table.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "test/surface/mesh_checks.hpp"

namespace fringe_fusion {
namespace {

using internal::CubeTable;
using internal::GetCubeEdge;
using Face = std::array<long, 3>;

constexpr int kSize = 14;  // voxels per side

int VoxelIndex(int x, int y, int z) { return (z * kSize + y) * kSize + x; }

// Identifies grid edges as 3 voxel + axis.
std::vector<Face> March(const std::vector<bool>& inside) {
  const CubeTable table;
  std::vector<Face> faces;
  const auto corner_voxel = [](int x, int y, int z, int c) {
    return VoxelIndex(x + (c & 1), y + ((c >> 1) & 1), z + (c >> 2));
  };
  for (int z = 0; z + 1 < kSize; ++z) {
    for (int y = 0; y + 1 < kSize; ++y) {
      for (int x = 0; x + 1 < kSize; ++x) {
        unsigned pattern = 0;
        for (int c = 0; c < 8; ++c) {
          if (inside[static_cast<std::size_t>(corner_voxel(x, y, z, c))]) pattern |= 1U << c;
        }
        for (const CubeTable::Triangle& triangle : table[pattern]) {
          Face face{};
          for (std::size_t i = 0; i < 3; ++i) {
            const internal::CubeEdge edge = GetCubeEdge(triangle[i]);
            face[i] = 3L * corner_voxel(x, y, z, edge.from) + edge.axis;
          }
          faces.push_back(face);
        }
      }
    }
  }
  return faces;
}

TEST(CubeTable, EdgesJoinNeighbouringCornersOnce) {
  std::set<std::pair<int, int>> pairs;
  for (int e = 0; e < internal::kCubeEdges; ++e) {
    const internal::CubeEdge edge = GetCubeEdge(e);
    EXPECT_EQ(edge.to - edge.from, 1 << edge.axis);
    EXPECT_EQ(edge.from & (1 << edge.axis), 0);
    pairs.insert({edge.from, edge.to});
  }
  EXPECT_EQ(pairs.size(), 12U);
}

TEST(CubeTable, UsesExactlyTheCrossedEdges) {
  const CubeTable table;
  for (unsigned pattern = 0; pattern < 256; ++pattern) {
    std::set<int> used;
    for (const CubeTable::Triangle& triangle : table[pattern]) {
      used.insert(triangle.begin(), triangle.end());
    }
    std::set<int> crossed;
    for (int e = 0; e < internal::kCubeEdges; ++e) {
      const internal::CubeEdge edge = GetCubeEdge(e);
      if (((pattern >> edge.from) & 1U) != ((pattern >> edge.to) & 1U)) crossed.insert(e);
    }
    EXPECT_EQ(used, crossed) << pattern;
  }
}

TEST(CubeTable, FacesTurnOutwards) {
  const CubeTable table;
  // Corner 0 inside: the triangle's normal points away from it.
  ASSERT_EQ(table[1].size(), 1U);
  std::array<Eigen::Vector3d, 3> points;
  for (std::size_t i = 0; i < 3; ++i) {
    points[i] = 0.5 * Eigen::Vector3d::Unit(GetCubeEdge(table[1][0][i]).axis);
  }
  const Eigen::Vector3d normal = (points[1] - points[0]).cross(points[2] - points[0]);
  EXPECT_GT(normal.minCoeff(), 0.0);
}

// Random signs hold every pattern beside every other: whatever happens in fields happens here.
TEST(CubeTable, RandomFieldsAreClosedManifolds) {
  for (const double share : {0.1, 0.3, 0.5, 0.7, 0.9}) {
    for (unsigned seed = 0; seed < 8; ++seed) {
      std::mt19937 random(seed);
      std::bernoulli_distribution is_inside(share);
      std::vector<bool> inside(kSize * kSize * kSize, false);
      for (int z = 1; z + 1 < kSize; ++z) {
        for (int y = 1; y + 1 < kSize; ++y) {
          for (int x = 1; x + 1 < kSize; ++x) {
            inside[static_cast<std::size_t>(VoxelIndex(x, y, z))] = is_inside(random);
          }
        }
      }
      const testing::EdgeCounts counts = testing::CountEdges(March(inside));
      EXPECT_GT(counts.num_edges, 1000);
      EXPECT_EQ(counts.num_boundary, 0);
      EXPECT_EQ(counts.num_non_manifold, 0);
    }
  }
}

}  // namespace
}  // namespace fringe_fusion
