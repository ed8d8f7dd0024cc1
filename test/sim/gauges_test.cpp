#include "fringe_fusion/sim/gauges.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <stdexcept>

#include "fringe_fusion/io/mesh_io.hpp"
#include "test/sim/topology.hpp"

namespace fringe_fusion::sim {
namespace {

TEST(Gauges, PlaneIsFlatAndOpen) {
  const Mesh plane = MakePlane(0.12, 6);
  EXPECT_EQ(plane.faces.size(), 72U);
  EXPECT_NEAR(Area(plane), 0.0144, 1e-9);
  for (const Eigen::Vector3f& normal : plane.normals) {
    EXPECT_LT((normal - Eigen::Vector3f::UnitZ()).norm(), 1e-6F);
  }
  EXPECT_FALSE(Topology(plane).closed);
}

TEST(Gauges, SphereHasItsRadiusEverywhere) {
  const Eigen::Vector3d center(0.01, -0.02, 0.03);
  const Mesh sphere = MakeSphere(center, 0.025, 5);
  for (const Eigen::Vector3f& vertex : sphere.vertices) {
    ASSERT_NEAR((vertex.cast<double>() - center).norm(), 0.025, 1e-8);
  }
  const MeshTopology topology = Topology(sphere);
  EXPECT_TRUE(topology.closed);
  EXPECT_EQ(topology.euler, 2);
  // Chords of 2 degrees lie inside of the sphere: half of their angle squared is lost, 6e-4.
  const double exact = 4.0 / 3.0 * M_PI * std::pow(0.025, 3);
  EXPECT_LT(Volume(sphere), exact);
  EXPECT_GT(Volume(sphere), exact * (1.0 - 6.2e-4));
  EXPECT_LT((sphere.normals[7] - (sphere.vertices[7] - center.cast<float>()).normalized()).norm(),
            1e-5F);
}

TEST(Gauges, BallBarHasItsLength) {
  const Mesh bar = MakeBallBar(0.07, 0.015);
  EXPECT_TRUE(Topology(bar).closed);
  for (const double side : {-1.0, 1.0}) {
    const Eigen::Vector3d center(0.035 * side, 0.0, 0.015);
    int on_sphere = 0;
    for (const Eigen::Vector3f& vertex : bar.vertices) {
      const double distance = (vertex.cast<double>() - center).norm();
      if (std::abs(distance - 0.015) < 1e-7) ++on_sphere;
    }
    EXPECT_GT(on_sphere, 40000);
  }
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& vertex : bar.vertices) box.extend(vertex);
  EXPECT_NEAR(box.min().z(), 0.0F, 1e-6F);
  EXPECT_NEAR(box.sizes().x(), 0.1F, 1e-5F);
}

TEST(Gauges, StepBlockHasItsVolume) {
  const Mesh block = MakeStepBlock(5, 0.008, 0.014, 0.04);
  const MeshTopology topology = Topology(block);
  EXPECT_TRUE(topology.closed);
  EXPECT_EQ(topology.euler, 2);
  EXPECT_NEAR(Volume(block), 15 * 0.008 * 0.014 * 0.04, 1e-11);
  // Bottom and all tops together, both sides, front and back.
  EXPECT_NEAR(Area(block), 2 * 0.07 * 0.04 + 2 * 15 * 0.008 * 0.014 + 2 * 0.04 * 0.04, 1e-9);
}

TEST(Gauges, PlateLiesBelowZero) {
  const Mesh plate = MakePlate(0.07, 0.005);
  EXPECT_TRUE(Topology(plate).closed);
  EXPECT_NEAR(Volume(plate), M_PI * 0.07 * 0.07 * 0.005, 2e-8);
  for (const Eigen::Vector3f& vertex : plate.vertices) {
    EXPECT_LE(vertex.z(), 0.0F);
    EXPECT_GE(vertex.z(), -0.0051F);
  }
}

TEST(Gauges, MakeObjectKnowsNamesAndFiles) {
  for (const char* name : {"plane", "sphere", "ball_bar", "step_block"}) {
    const Result<Mesh> mesh = MakeObject(name);
    ASSERT_TRUE(mesh) << name;
    EXPECT_GT(mesh->faces.size(), 50U) << name;
  }
  const Result<Mesh> unknown = MakeObject("teapot");
  ASSERT_FALSE(unknown);
  EXPECT_NE(unknown.error().message.find("teapot"), std::string::npos);
  EXPECT_FALSE(MakeObject("missing_file.ply"));
  const std::string path = testing::TempDir() + "gauges_test_plate.ply";
  ASSERT_TRUE(WriteMesh(MakePlate(0.07, 0.005), path));
  const Result<Mesh> file = MakeObject(path);
  ASSERT_TRUE(file);
  EXPECT_EQ(file->faces.size(), MakePlate(0.07, 0.005).faces.size());
}

TEST(Gauges, RefuseImpossibleSizes) {
  EXPECT_THROW((void)MakePlane(0.1, 0), std::invalid_argument);
  EXPECT_THROW((void)MakeSphere(Eigen::Vector3d::Zero(), 0.1, -1), std::invalid_argument);
  EXPECT_THROW((void)MakeStepBlock(0, 0.1, 0.1, 0.1), std::invalid_argument);
  EXPECT_THROW((void)MakeFreeform(0.0), std::invalid_argument);
}

}  // namespace
}  // namespace fringe_fusion::sim
