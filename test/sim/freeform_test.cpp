#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "fringe_fusion/sim/gauges.hpp"
#include "src/sim/ray_scene.hpp"
#include "test/sim/topology.hpp"

namespace fringe_fusion::sim {
namespace {

TEST(Freeform, IsOneClosedBodyWithThreeHoles) {
  const Mesh mesh = MakeFreeform(1e-3);
  const MeshTopology topology = Topology(mesh);
  EXPECT_TRUE(topology.closed);
  EXPECT_EQ(topology.euler, 2 - 2 * 3);
  // Smaller than its box, larger than its body's ellipsoid alone.
  EXPECT_GT(Volume(mesh), 3e-5);
  EXPECT_LT(Volume(mesh), 1e-4);
}

TEST(Freeform, StandsOnZeroAndIsEightyMillimetresTall) {
  const Mesh mesh = MakeFreeform(1e-3);
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3f& vertex : mesh.vertices) box.extend(vertex.cast<double>());
  EXPECT_NEAR(box.min().z(), 0.0, 1e-4);
  EXPECT_NEAR(box.max().z(), 0.080, 2e-3);
  EXPECT_LT(box.sizes().x(), 0.08);
  EXPECT_LT(box.sizes().y(), 0.06);
}

TEST(Freeform, RibsAreThinAndWindowsOpen) {
  const Result<RayScene> scene = RayScene::Create(MakeFreeform(6e-4), Mesh{});
  ASSERT_TRUE(scene);
  for (const double side : {-1.0, 1.0}) {
    const auto right = scene->Cast({0.03, 0.016 * side, 0.0125}, {-1.0, 0.0, 0.0});
    const auto left = scene->Cast({0.008, 0.016 * side, 0.0125}, {1.0, 0.0, 0.0});
    ASSERT_TRUE(right && left);
    EXPECT_NEAR(right->point.x() - left->point.x(), 1.8e-3, 1e-4);
  }
  // The window crosses the whole body along y.
  EXPECT_FALSE(scene->Cast({0.003, 0.1, 0.042}, {0.0, -1.0, 0.0}));
}

TEST(Freeform, FinerMeshesConverge) {
  // The volume error of a triangulated smooth surface falls with the square of the cell size.
  const double coarse = Volume(MakeFreeform(2e-3));
  const double medium = Volume(MakeFreeform(1e-3));
  const double fine = Volume(MakeFreeform(7e-4));
  EXPECT_LT(std::abs(medium - fine), 0.6 * std::abs(coarse - medium));
}

}  // namespace
}  // namespace fringe_fusion::sim
