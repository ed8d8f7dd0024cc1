#include "src/sim/interreflection.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "fringe_fusion/geometry/camera_model.hpp"
#include "test/sim/scenes.hpp"

namespace fringe_fusion::sim {
namespace {

// A floor z = 0 and a wall y = 0.03 facing -y, both 0.12 m wide and meeting in a corner.
Mesh Corner() {
  Mesh mesh;
  mesh.vertices = {{-0.06F, -0.05F, 0.0F}, {0.06F, -0.05F, 0.0F},  {0.06F, 0.03F, 0.0F},
                   {-0.06F, 0.03F, 0.0F},  {-0.06F, 0.03F, 0.06F}, {0.06F, 0.03F, 0.06F}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}, {3, 2, 5}, {3, 5, 4}};
  return mesh;
}

// Irradiance at a floor point by the lit wall, summed over small patches.
double IntegrateWall(const SimConfig& config, const CellCalibration& calibration,
                     const Transform& T_object_camera, const Eigen::Vector3d& point) {
  const Transform T_projector_object = calibration.T_projector_camera * T_object_camera.inverse();
  const Eigen::Vector3d projector = T_projector_object.inverse().translation();
  const double nominal = NominalDistance(calibration);
  constexpr double kStep = 5e-4;
  double sum = 0.0;
  for (double x = -0.06 + 0.5 * kStep; x < 0.06; x += kStep) {
    for (double z = 0.5 * kStep; z < 0.06; z += kStep) {
      const Eigen::Vector3d patch(x, 0.03, z);
      if (!Covers(calibration.projector,
                  Project(calibration.projector, T_projector_object * patch))) {
        continue;
      }
      const Eigen::Vector3d to_projector = projector - patch;
      const double lambert = -to_projector.y() / to_projector.norm();
      const double radiance = config.albedo * lambert * std::pow(nominal / to_projector.norm(), 2);
      const Eigen::Vector3d apart = patch - point;
      const double r2 = apart.squaredNorm();
      sum += radiance * apart.z() * apart.y() / (r2 * r2) / M_PI * kStep * kStep;
    }
  }
  return sum;
}

TEST(Interreflection, FloorReceivesTheLightOfTheWall) {
  const CellCalibration calibration = SmallScanner();
  const SimConfig config;
  const Result<RayScene> scene = RayScene::Create(Corner(), Mesh{});
  // From the side of -y, so that both devices see floor and wall.
  Transform T = Transform::Identity();
  T.linear() = ExpRotation({0.0, 0.0, -0.5 * M_PI});
  T = T * TurntablePose(0, 1, 0.5, 40.0, Eigen::Vector3d::Zero());
  const Shader shader(config, calibration, *scene, T);
  const Image<Eigen::Vector2d> rays = PixelRays(calibration.camera);
  const ViewSamples view = CastView(*scene, shader, calibration.camera, rays, T);
  const Interreflection bounce(*scene, shader, view, rays, T);
  const ProjectedLight light(config, Flat(calibration, 255), 0.0);
  const Image<float> irradiance = bounce.Irradiance(light, 0.0F);

  int count = 0;
  double mean_ratio = 0.0;
  for (int y = 0; y < irradiance.height(); y += 3) {
    for (int x = 0; x < irradiance.width(); x += 3) {
      const RayHit hit = CastPixel(*scene, T, rays(x, y));
      if (hit.face < 0 || std::abs(hit.point.z()) > 1e-6 || std::abs(hit.point.x()) > 0.04)
        continue;
      if (hit.point.y() > 0.027 || hit.point.y() < 0.0) continue;
      const double expected = IntegrateWall(config, calibration, T, hit.point);
      EXPECT_NEAR(static_cast<double>(irradiance(x, y)) / expected, 1.0, 0.3);
      mean_ratio += static_cast<double>(irradiance(x, y)) / expected;
      ++count;
    }
  }
  ASSERT_GT(count, 30);
  EXPECT_NEAR(mean_ratio / count, 1.0, 0.04);
}

TEST(Interreflection, NothingToReflectGivesNothing) {
  const CellCalibration calibration = SmallScanner();
  const SimConfig config;
  const Result<RayScene> scene = RayScene::Create(MakePlane(0.3, 4), Mesh{});
  const Shader shader(config, calibration, *scene, TopView());
  const Image<Eigen::Vector2d> rays = PixelRays(calibration.camera);
  const ViewSamples view = CastView(*scene, shader, calibration.camera, rays, TopView());
  const Interreflection bounce(*scene, shader, view, rays, TopView());
  const ProjectedLight light(config, Flat(calibration, 255), 0.0);
  const Image<float> irradiance = bounce.Irradiance(light, 0.0F);
  EXPECT_EQ(irradiance.width(), calibration.camera.width);
  for (const float value : irradiance) ASSERT_EQ(value, 0.0F);
  EXPECT_TRUE(Interreflection().Irradiance(light, 0.0F).empty());
}

}  // namespace
}  // namespace fringe_fusion::sim
