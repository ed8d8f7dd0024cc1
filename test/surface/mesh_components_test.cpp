#include "src/surface/mesh_components.hpp"

#include <gtest/gtest.h>

namespace fringe_fusion {
namespace {

// A strip of two triangles (vertices 0 1 3 4) and a single triangle (2 5 6); vertex 7 is unused.
Mesh TwoPieces() {
  Mesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.vertices.emplace_back(static_cast<float>(i), 0.0F, 0.0F);
    mesh.sigma.push_back(static_cast<float>(i));
    mesh.num_views.push_back(static_cast<std::uint8_t>(i));
  }
  mesh.faces = {{2, 5, 6}, {0, 1, 3}, {3, 1, 4}};
  mesh.filled_faces = {1, 0, 2};
  return mesh;
}

TEST(MeshComponents, RemovesTheSmallPieceAndKeepsAttributes) {
  const internal::ComponentResult result = internal::RemoveSmallComponents(TwoPieces(), 2);
  EXPECT_EQ(result.num_components, 2);
  EXPECT_EQ(result.num_removed, 1);
  EXPECT_EQ(result.largest_faces, 2);
  ASSERT_EQ(result.mesh.faces.size(), 2U);
  EXPECT_EQ(result.mesh.faces[0], Eigen::Vector3i(0, 1, 2));
  EXPECT_EQ(result.mesh.faces[1], Eigen::Vector3i(2, 1, 3));
  EXPECT_EQ(result.mesh.sigma, (std::vector<float>{0.0F, 1.0F, 3.0F, 4.0F}));
  EXPECT_EQ(result.mesh.num_views, (std::vector<std::uint8_t>{0, 1, 3, 4}));
  EXPECT_EQ(result.mesh.filled_faces, (std::vector<std::uint8_t>{0, 2}));
  EXPECT_TRUE(result.mesh.colors.empty());
}

TEST(MeshComponents, KeepsAllButUnusedVerticesAtZero) {
  const internal::ComponentResult result = internal::RemoveSmallComponents(TwoPieces(), 0);
  EXPECT_EQ(result.mesh.faces.size(), 3U);
  EXPECT_EQ(result.mesh.vertices.size(), 7U);
}

TEST(MeshComponents, MayLeaveNothing) {
  EXPECT_TRUE(internal::RemoveSmallComponents(TwoPieces(), 3).mesh.vertices.empty());
  EXPECT_TRUE(internal::RemoveSmallComponents(Mesh{}, 3).mesh.vertices.empty());
}

}  // namespace
}  // namespace fringe_fusion
