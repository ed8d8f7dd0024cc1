#include "src/sim/truth.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "fringe_fusion/geometry/camera_model.hpp"
#include "test/sim/scenes.hpp"

namespace fringe_fusion::sim {
namespace {

TEST(Truth, PlaneIsTheAnalyticIntersection) {
  const CellCalibration calibration = DefaultCalibration();
  SimCell cell = MakeCell(SimConfig{}, calibration, MakePlane(0.4, 7));
  const Transform T = TurntablePose(1, 7, 0.5, 50.0, Eigen::Vector3d(0.003, 0.002, 0.0));
  ASSERT_TRUE(cell.MoveTo(T, 0));
  const ViewTruth truth = cell.Truth();
  EXPECT_LT((truth.T_object_camera.matrix() - T.matrix()).norm(), 1e-15);
  const Eigen::Vector3d normal_camera = T.linear().transpose() * Eigen::Vector3d::UnitZ();
  int count = 0;
  for (int y = 0; y < calibration.camera.height; y += 7) {
    for (int x = 0; x < calibration.camera.width; x += 7) {
      const Eigen::Vector2d n = Undistort(calibration.camera, Eigen::Vector2d(x, y));
      const Eigen::Vector3d direction = T.linear() * n.homogeneous();
      const Eigen::Vector3d point = -T.translation().z() / direction.z() * n.homogeneous();
      ASSERT_LT((truth.points(x, y).cast<double>() - point).norm(), 1e-7);
      ASSERT_LT((truth.normals(x, y).cast<double>() - normal_camera).norm(), 1e-6);
      const Eigen::Vector2d uv =
          Project(calibration.projector, calibration.T_projector_camera * point);
      ASSERT_NEAR(static_cast<double>(truth.u(x, y)), uv.x(), 1e-3);
      ASSERT_NEAR(static_cast<double>(truth.v(x, y)), uv.y(), 1e-3);
      ++count;
    }
  }
  EXPECT_GT(count, 9000);
}

TEST(Truth, NothingHitIsNan) {
  const CellCalibration calibration = SmallScanner();
  SimCell cell = MakeCell(SimConfig{}, calibration, MakePlane(0.02, 1));
  ASSERT_TRUE(cell.MoveTo(TopView(), 0));
  const ViewTruth truth = cell.Truth();
  EXPECT_TRUE(std::isnan(truth.u(0, 0)));
  EXPECT_TRUE(truth.points(0, 0).array().isNaN().all());
  EXPECT_EQ(truth.lit(0, 0), 0);
  EXPECT_EQ(truth.on_part(0, 0), 0);
}

// A small plane over a large one: shadow and cover follow from the segment to each device.
TEST(Truth, ShadowIsWhereTheSegmentToTheProjectorIsBlocked) {
  const CellCalibration calibration = SmallScanner();
  Mesh lid = MakePlane(0.03, 1);
  for (Eigen::Vector3f& vertex : lid.vertices) vertex.z() = 0.02F;
  SimCell cell = MakeCell(SimConfig{}, calibration, lid, MakePlane(0.5, 1));
  const Transform T = TopView();
  ASSERT_TRUE(cell.MoveTo(T, 0));
  const ViewTruth truth = cell.Truth();
  const Eigen::Vector3d projector = T * calibration.T_projector_camera.inverse().translation();
  int num_shadow = 0;
  for (int y = 0; y < calibration.camera.height; ++y) {
    for (int x = 0; x < calibration.camera.width; ++x) {
      const Eigen::Vector3d point = T * truth.points(x, y).cast<double>();
      if (truth.on_part(x, y) != 0) {
        ASSERT_NEAR(point.z(), 0.02, 1e-6);
        ASSERT_EQ(truth.lit(x, y), 1);
        continue;
      }
      ASSERT_NEAR(point.z(), 0.0, 1e-6);
      const double share = 0.02 / projector.z();
      const Eigen::Vector3d crossing = point + share * (projector - point);
      const double outside = crossing.head<2>().cwiseAbs().maxCoeff() - 0.015;
      if (std::abs(outside) < 1e-5) continue;
      const bool covered = truth.u(x, y) >= -0.5F && truth.v(x, y) >= -0.5F &&
                           truth.u(x, y) < static_cast<float>(calibration.projector.width) - 0.5F &&
                           truth.v(x, y) < static_cast<float>(calibration.projector.height) - 0.5F;
      ASSERT_EQ(truth.lit(x, y) != 0, outside > 0.0 && covered) << x << " " << y;
      num_shadow += outside < 0.0 ? 1 : 0;
    }
  }
  EXPECT_GT(num_shadow, 50);
}

TEST(Truth, VisibleFacesAreSeenByBothDevices) {
  const CellCalibration calibration = SmallScanner();
  const Mesh sphere = MakeSphere({0.0, 0.0, 0.03}, 0.03, 4);
  SimCell cell = MakeCell(SimConfig{}, calibration, sphere, MakePlate(0.1, 0.005));
  ASSERT_TRUE(cell.MoveTo(TopView(), 0));
  const ViewTruth truth = cell.Truth();
  ASSERT_EQ(truth.face_visible.size(), sphere.faces.size());
  const Eigen::Vector3d camera = TopView().translation();
  const Eigen::Vector3d projector =
      TopView() * calibration.T_projector_camera.inverse().translation();
  for (std::size_t i = 0; i < sphere.faces.size(); ++i) {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k) {
      middle += sphere.vertices[static_cast<std::size_t>(sphere.faces[i][k])].cast<double>() / 3.0;
    }
    const Eigen::Vector3d normal = (middle - Eigen::Vector3d(0.0, 0.0, 0.03)).normalized();
    const double low = std::min(normal.dot((camera - middle).normalized()),
                                normal.dot((projector - middle).normalized()));
    // Facets within a few degrees of the horizon can go either way.
    if (std::abs(low) < 0.06) continue;
    EXPECT_EQ(truth.face_visible[i] != 0, low > 0.0) << i;
  }
}

TEST(Truth, ALargeFaceIsSeenByItsPixels) {
  // The middle of both faces lies outside of the field of view.
  Mesh strip;
  strip.vertices = {
      {-0.01F, -0.02F, 0.0F}, {3.0F, -0.02F, 0.0F}, {3.0F, 0.02F, 0.0F}, {-0.01F, 0.02F, 0.0F}};
  strip.faces = {{0, 1, 2}, {0, 2, 3}};
  SimCell cell = MakeCell(SimConfig{}, SmallScanner(), strip);
  ASSERT_TRUE(cell.MoveTo(TopView(), 0));
  const std::vector<std::uint8_t> visible = cell.Truth().face_visible;
  EXPECT_EQ(std::accumulate(visible.begin(), visible.end(), 0), 2);
}

}  // namespace
}  // namespace fringe_fusion::sim
