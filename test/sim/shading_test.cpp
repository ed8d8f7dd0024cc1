#include "src/sim/shading.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "fringe_fusion/geometry/camera_model.hpp"
#include "test/sim/scenes.hpp"

namespace fringe_fusion::sim {
namespace {

// Shades the point of a z = 0 plane under the camera's pixel, seen from above.
class PlaneShading : public testing::Test {
 protected:
  SurfaceSample ShadeAt(const SimConfig& config, double x, double y,
                        const Transform& T_object_camera = TopView()) const {
    const Shader shader(config, calibration_, *scene_, T_object_camera);
    const Eigen::Vector3d camera = T_object_camera.translation();
    const auto hit = scene_->Cast(camera, Eigen::Vector3d(x, y, 0.0) - camera);
    return shader.Shade(*hit, camera, true);
  }
  [[nodiscard]] Eigen::Vector3d ProjectorObject() const {
    return TopView() * calibration_.T_projector_camera.inverse().translation();
  }

  CellCalibration calibration_ = DefaultCalibration();
  Result<RayScene> scene_ = RayScene::Create(MakePlane(0.5, 1), Mesh{});
};

TEST_F(PlaneShading, LambertFollowsCosineAndInverseSquare) {
  SimConfig config;
  config.albedo = 0.6;
  const double nominal = NominalDistance(calibration_);
  for (const auto& [x, y] : {std::pair(0.0, 0.0), std::pair(0.04, -0.02), std::pair(-0.05, 0.03)}) {
    const Eigen::Vector3d to_projector = ProjectorObject() - Eigen::Vector3d(x, y, 0.0);
    const double distance = to_projector.norm();
    const double expected = 0.6 * to_projector.z() / distance * std::pow(nominal / distance, 2);
    const SurfaceSample sample = ShadeAt(config, x, y);
    EXPECT_TRUE(sample.lit);
    EXPECT_NEAR(sample.direct, expected, 1e-6);
    EXPECT_NEAR(sample.albedo, 0.6, 1e-7);
  }
}

TEST_F(PlaneShading, LobePeaksAtTheMirrorDirection) {
  SimConfig config;
  const double diffuse = static_cast<double>(ShadeAt(config, 0.0, 0.0).direct);
  config.specular_ratio = 2.0;
  // A camera in the mirror direction of the projector about the plane's normal.
  const Eigen::Vector3d mirror = ProjectorObject().cwiseProduct(Eigen::Vector3d(-1.0, -1.0, 1.0));
  Transform T = TopView();
  const Shader shader(config, calibration_, *scene_, T);
  const auto hit = scene_->Cast({0.0, 0.0, 0.5}, {0.0, 0.0, -1.0});
  const double nominal = NominalDistance(calibration_);
  const double falloff = std::pow(nominal / ProjectorObject().norm(), 2);
  const double at_mirror = static_cast<double>(shader.Shade(*hit, mirror, true).direct);
  EXPECT_NEAR(at_mirror, diffuse + 0.7 * 2.0 * falloff, 1e-5);
  // Half way between two directions 22 degrees apart the lobe has fallen to cos^30.
  const Eigen::Vector3d above(0.0, 0.0, 0.5);
  const Eigen::Vector3d half = (above.normalized() + ProjectorObject().normalized()).normalized();
  const double at_camera = static_cast<double>(shader.Shade(*hit, above, true).direct);
  EXPECT_NEAR(at_camera, diffuse + 0.7 * 2.0 * falloff * std::pow(half.z(), 30.0), 1e-5);
  EXPECT_NEAR(static_cast<double>(shader.Shade(*hit, mirror, false).direct), diffuse, 1e-6);
}

TEST_F(PlaneShading, TextureIsASolidCheckerOfTheAlbedo) {
  SimConfig config;
  config.texture_contrast = 0.4;
  config.texture_period_m = 0.01;
  int bright = 0;
  int dark = 0;
  for (int i = 0; i < 400; ++i) {
    const double x = -0.05 + 0.1 * ((i * 37) % 400) / 400.0;
    const double y = -0.03 + 0.06 * i / 400.0;
    const double albedo = static_cast<double>(ShadeAt(config, x, y).albedo);
    bright += std::abs(albedo - 0.7) < 1e-6 ? 1 : 0;
    dark += std::abs(albedo - 0.7 * 0.6) < 1e-6 ? 1 : 0;
    // One period on, the same cell again; half a period on, the other.
    EXPECT_EQ(ShadeAt(config, x + 0.01, y).albedo, ShadeAt(config, x, y).albedo);
    EXPECT_NE(ShadeAt(config, x + 0.005, y).albedo, ShadeAt(config, x, y).albedo);
  }
  EXPECT_EQ(bright + dark, 400);
  EXPECT_NEAR(bright, 200, 40);
}

TEST_F(PlaneShading, BeyondThePictureNothingIsLit) {
  const SurfaceSample outside = ShadeAt(SimConfig{}, 0.24, 0.0);
  EXPECT_FALSE(outside.lit);
  EXPECT_EQ(outside.direct, 0.0F);
  EXPECT_GE(outside.face, 0);
}

TEST_F(PlaneShading, TheBackOfASurfaceIsNotLit) {
  // Camera below the plane, projector too: both see the back, which is lit as any side; with the
  // projector alone on the other side it is dark.
  CellCalibration opposite = calibration_;
  Transform T_camera_projector = Transform::Identity();
  T_camera_projector.linear() =
      Eigen::AngleAxisd(3.14159265358979, Eigen::Vector3d::UnitX()).toRotationMatrix();
  T_camera_projector.translation() = Eigen::Vector3d(0.0, 0.0, 1.0);
  opposite.T_projector_camera = T_camera_projector.inverse();
  const SimConfig config;
  const Shader shader(config, opposite, *scene_, TopView());
  const auto hit = scene_->Cast({0.0, 0.0, 0.5}, {0.0, 0.0, -1.0});
  EXPECT_FALSE(shader.Shade(*hit, {0.0, 0.0, 0.5}, true).lit);
}

TEST(Shading, NominalDistanceOfKnownGeometry) {
  CellCalibration calibration = DefaultCalibration();
  calibration.projector.cx = 639.5;
  calibration.projector.cy = 399.5;
  calibration.projector.distortion = {};
  // Projector 0.3 m beside the camera, turned so that its axis meets the camera's at 0.4 m.
  Transform T_camera_projector = Transform::Identity();
  T_camera_projector.linear() =
      Eigen::AngleAxisd(-std::atan2(0.3, 0.4), Eigen::Vector3d::UnitY()).toRotationMatrix();
  T_camera_projector.translation() = Eigen::Vector3d(0.3, 0.0, 0.0);
  calibration.T_projector_camera = T_camera_projector.inverse();
  EXPECT_NEAR(NominalDistance(calibration), 0.5, 1e-9);
  // Parallel axes never meet.
  T_camera_projector.linear().setIdentity();
  calibration.T_projector_camera = T_camera_projector.inverse();
  EXPECT_NEAR(NominalDistance(calibration), 0.75, 1e-9);
}

TEST(Shading, FoldedProjectionIsNan) {
  CameraModel model = DefaultCalibration().projector;
  model.distortion = {-0.5, 0.0, 0.0, 0.0, 0.0};
  // x (1 - x^2 / 2) is 0 again at x = sqrt(2): a plain projection puts that point in the middle.
  const Eigen::Vector3d far_out(std::sqrt(2.0), 0.0, 1.0);
  EXPECT_TRUE(Covers(model, Project(model, far_out)));
  EXPECT_FALSE(Covers(model, ProjectSafely(model, far_out)));
  EXPECT_FALSE(Covers(model, ProjectSafely(model, {0.0, 0.0, -1.0})));
  EXPECT_TRUE(Covers(model, ProjectSafely(model, {0.01, 0.0, 1.0})));
}

}  // namespace
}  // namespace fringe_fusion::sim
