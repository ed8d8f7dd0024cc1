#include "src/sim/view_samples.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "fringe_fusion/geometry/camera_model.hpp"
#include "test/sim/scenes.hpp"

namespace fringe_fusion::sim {
namespace {

ViewSamples Cast(const Mesh& part, const Mesh& background) {
  const CellCalibration calibration = SmallScanner();
  const Result<RayScene> scene = RayScene::Create(part, background);
  const SimConfig config;
  const Shader shader(config, calibration, *scene, TopView());
  return CastView(*scene, shader, calibration.camera, PixelRays(calibration.camera), TopView());
}

TEST(ViewSamples, AFlatSurfaceHasNoEdges) {
  const ViewSamples view = Cast(MakePlane(0.5, 3), Mesh{});
  for (const SurfaceSample& sample : view.centers) ASSERT_GE(sample.face, 0);
  EXPECT_TRUE(view.edges.empty());
}

TEST(ViewSamples, ASilhouetteIsSampledNineTimes) {
  const ViewSamples view = Cast(MakePlane(0.05, 3), Mesh{});
  ASSERT_FALSE(view.edges.empty());
  EXPECT_EQ(view.edge_samples.size(), view.edges.size() * kEdgeSamples);
  int mixed = 0;
  for (const EdgePixel& edge : view.edges) {
    int hits = 0;
    for (int k = 0; k < kEdgeSamples; ++k) {
      hits += view.edge_samples[static_cast<std::size_t>(edge.first + k)].face >= 0 ? 1 : 0;
    }
    // The middle sample is the centre ray.
    EXPECT_EQ(view.edge_samples[static_cast<std::size_t>(edge.first + 4)].face,
              view.centers[static_cast<std::size_t>(edge.pixel)].face);
    mixed += hits > 0 && hits < kEdgeSamples ? 1 : 0;
  }
  // The outline of a 50 mm square at about 1 mm per pixel crosses some 200 pixels.
  EXPECT_GT(mixed, 60);
  EXPECT_LT(view.edges.size(), 500U);
}

TEST(ViewSamples, AStepAndACreaseAreEdges) {
  const ViewSamples flat = Cast(MakePlane(0.5, 1), Mesh{});
  const ViewSamples block = Cast(MakeStepBlock(3, 0.01, 0.015, 0.04), MakePlane(0.5, 1));
  EXPECT_TRUE(flat.edges.empty());
  EXPECT_GT(block.edges.size(), 200U);
}

TEST(ViewSamples, RaysBeyondTheFoldHitNothing) {
  CameraModel camera = SmallScanner().camera;
  camera.fx = camera.fy = 100.0;
  camera.distortion = {-0.5, 0.0, 0.0, 0.0, 0.0};
  const Image<Eigen::Vector2d> rays = PixelRays(camera);
  EXPECT_FALSE(rays(0, 0).allFinite());
  const Result<RayScene> scene = RayScene::Create(MakePlane(100.0, 1), Mesh{});
  EXPECT_LT(CastPixel(*scene, TopView(), rays(0, 0)).face, 0);
  EXPECT_GE(CastPixel(*scene, TopView(), rays(100, 75)).face, 0);
}

}  // namespace
}  // namespace fringe_fusion::sim
