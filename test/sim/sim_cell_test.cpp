#include "fringe_fusion/sim/sim_cell.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/sim/gauges.hpp"
#include "test/sim/scenes.hpp"

namespace fringe_fusion::sim {
namespace {

TEST(SimCell, PlaneTruthIsTheAnalyticIntersection) {
  const CellCalibration calibration = DefaultCalibration();
  SimCell cell = MakeCell(SimConfig{}, MakePlane(0.4, 7));
  const Transform T = TurntablePose(1, 7, 0.5, 50.0, Eigen::Vector3d(0.003, 0.002, 0.0));
  ASSERT_TRUE(cell.MoveTo(T, 0));
  const ViewTruth truth = cell.Truth();
  int count = 0;
  for (int y = 0; y < calibration.camera.height; y += 7) {
    for (int x = 0; x < calibration.camera.width; x += 7) {
      const Eigen::Vector2d n = Undistort(calibration.camera, Eigen::Vector2d(x, y));
      const Eigen::Vector3d direction = T.linear() * n.homogeneous();
      const double t = -T.translation().z() / direction.z();
      const Eigen::Vector3d point_camera = t * n.homogeneous();
      ASSERT_LT((truth.points(x, y).cast<double>() - point_camera).norm(), 1e-7);
      const Eigen::Vector2d uv =
          Project(calibration.projector, calibration.T_projector_camera * point_camera);
      ASSERT_NEAR(static_cast<double>(truth.u(x, y)), uv.x(), 1e-3);
      ASSERT_NEAR(static_cast<double>(truth.v(x, y)), uv.y(), 1e-3);
      ++count;
    }
  }
  EXPECT_GT(count, 1000);
}

}  // namespace
}  // namespace fringe_fusion::sim
