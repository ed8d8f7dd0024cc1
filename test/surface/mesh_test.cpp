#include "fringe_fusion/surface/mesh.hpp"

#include <gtest/gtest.h>

namespace fringe_fusion {
namespace {

// Two triangles with a common edge: one in z = 0 of area 1/2, one in x = 0 of area 1.
Mesh TwoTriangles() {
  Mesh mesh;
  mesh.vertices = {{1.0F, 0.0F, 0.0F}, {0.0F, 1.0F, 0.0F}, {0.0F, 0.0F, 0.0F}, {0.0F, 0.0F, 2.0F}};
  mesh.faces = {{0, 1, 2}, {2, 1, 3}};
  return mesh;
}

TEST(Mesh, AreaSumsTheFaces) {
  EXPECT_NEAR(Area(TwoTriangles()), 0.5 + 1.0, 1e-12);
  EXPECT_EQ(Area(Mesh{}), 0.0);
}

TEST(Mesh, NormalsAreWeightedByArea) {
  const std::vector<Eigen::Vector3f> normals = ComputeNormals(TwoTriangles());
  ASSERT_EQ(normals.size(), 4U);
  EXPECT_LT((normals[0] - Eigen::Vector3f::UnitZ()).norm(), 1e-6F);
  EXPECT_LT((normals[3] - Eigen::Vector3f::UnitX()).norm(), 1e-6F);
  // The shared vertices see the x face with twice the weight of the z face.
  const Eigen::Vector3f expected = Eigen::Vector3f(2.0F, 0.0F, 1.0F).normalized();
  EXPECT_LT((normals[1] - expected).norm(), 1e-6F);
  EXPECT_LT((normals[2] - expected).norm(), 1e-6F);
}

}  // namespace
}  // namespace fringe_fusion
