#include "src/sim/ray_scene.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "fringe_fusion/sim/gauges.hpp"

namespace fringe_fusion::sim {
namespace {

TEST(RayScene, CastFindsTheNearestFaceAndItsSide) {
  Mesh upper = MakePlane(0.1, 3);
  for (Eigen::Vector3f& vertex : upper.vertices) vertex.z() = 0.02F;
  const Result<RayScene> scene = RayScene::Create(MakePlane(0.2, 2), upper);
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene->num_part_faces(), 8);
  const auto from_above = scene->Cast({0.013, 0.004, 0.5}, {0.0, 0.0, -1.0});
  ASSERT_TRUE(from_above);
  EXPECT_GE(from_above->face, 8);
  EXPECT_LT((from_above->point - Eigen::Vector3d(0.013, 0.004, 0.02F)).norm(), 1e-12);
  EXPECT_LT((from_above->normal - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
  const auto from_below = scene->Cast({0.013, 0.004, -0.5}, {0.0, 0.0, 2.0});
  ASSERT_TRUE(from_below);
  EXPECT_LT(from_below->face, 8);
  EXPECT_LT((from_below->normal + Eigen::Vector3d::UnitZ()).norm(), 1e-12);
  EXPECT_FALSE(scene->Cast({0.3, 0.0, 0.5}, {0.0, 0.0, -1.0}));
}

TEST(RayScene, PointsAreExactToDoublePrecision) {
  const Result<RayScene> scene = RayScene::Create(MakePlane(1.0, 11), Mesh{});
  ASSERT_TRUE(scene);
  const Eigen::Vector3d origin(0.123456789, -0.3, 0.7);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d direction(0.003 * i - 0.31, 0.2 - 0.002 * i, -1.0);
    const auto hit = scene->Cast(origin, direction);
    ASSERT_TRUE(hit);
    EXPECT_LT((hit->point - (origin + 0.7 * direction)).norm(), 1e-14);
  }
}

TEST(RayScene, SeesUnlessSomethingIsBetween) {
  Mesh upper = MakePlane(0.1, 3);
  for (Eigen::Vector3f& vertex : upper.vertices) vertex.z() = 0.02F;
  const Result<RayScene> scene = RayScene::Create(MakePlane(0.4, 5), upper);
  ASSERT_TRUE(scene);
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d device(0.0, 0.0, 0.5);
  EXPECT_FALSE(scene->Sees({0.01, 0.02, 0.0}, up, device));
  EXPECT_TRUE(scene->Sees({0.15, 0.02, 0.0}, up, device));
  // Just inside and outside the shadow's edge at 0.05 * 0.5 / 0.48 = 0.0520833.
  EXPECT_FALSE(scene->Sees({0.05205, 0.0, 0.0}, up, device));
  EXPECT_TRUE(scene->Sees({0.05212, 0.0, 0.0}, up, device));
  // Something behind the device does not shade.
  EXPECT_TRUE(scene->Sees({0.01, 0.02, 0.0}, up, {0.0, 0.0, 0.01}));
}

TEST(RayScene, RefusesBadMeshes) {
  EXPECT_FALSE(RayScene::Create(Mesh{}, MakePlane(0.1, 1)));
  Mesh mesh = MakePlane(0.1, 1);
  mesh.faces[1][2] = 99;
  const Result<RayScene> range = RayScene::Create(mesh, Mesh{});
  ASSERT_FALSE(range);
  EXPECT_EQ(range.error().message, "object: face 1 names vertex 99, but there are 4");
  mesh = MakePlane(0.1, 1);
  mesh.vertices[3].y() = std::numeric_limits<float>::quiet_NaN();
  const Result<RayScene> nan = RayScene::Create(MakePlane(0.1, 1), mesh);
  ASSERT_FALSE(nan);
  EXPECT_EQ(nan.error().message, "background: vertex 3 is not finite");
}

TEST(RayScene, SliverHitsStayOnTheSliver) {
  Mesh mesh;
  mesh.vertices = {{0.0F, 0.0F, 0.0F}, {0.1F, 0.0F, 0.0F}, {0.05F, 1e-7F, 1e-7F}};
  mesh.faces = {{0, 1, 2}};
  const Result<RayScene> scene = RayScene::Create(mesh, Mesh{});
  ASSERT_TRUE(scene);
  const RayHit hit = scene->Intersect(0, {0.02, 0.3, 0.3}, {0.0, -1.0, -1.0});
  EXPECT_LT(std::abs(hit.point.y()), 0.06);
  EXPECT_LT(std::abs(hit.point.z()), 0.06);
}

}  // namespace
}  // namespace fringe_fusion::sim
