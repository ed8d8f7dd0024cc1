#include "fringe_fusion/registration/grid_projection.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "test/registration/bumpy_views.hpp"
#include "test/registration/plane_views.hpp"

namespace fringe_fusion {
namespace {

double WorstPixelError(const RangeImage& range, const GridProjection& grid) {
  double worst = 0.0;
  for (int y = 0; y < range.height; ++y) {
    for (int x = 0; x < range.width; ++x) {
      if (!range.points(x, y).allFinite()) continue;
      const auto pixel = grid.Project(range.points(x, y));
      if (!pixel) return std::numeric_limits<double>::infinity();
      const Eigen::Vector2f error =
          *pixel - Eigen::Vector2f(static_cast<float>(x), static_cast<float>(y));
      worst = std::max(worst, static_cast<double>(error.cwiseAbs().maxCoeff()));
    }
  }
  return worst;
}

TEST(GridProjection, FindsThePixelsOfACamera) {
  testing::BumpyScene scene;
  scene.num_views = 1;
  const RangeImage range = testing::MakeBumpyGraph(scene).graph.views.front().range;
  const auto grid = GridProjection::Fit(range);
  ASSERT_TRUE(grid);
  EXPECT_LT(WorstPixelError(range, *grid), 0.01);
  EXPECT_FALSE(grid->Project(Eigen::Vector3f(0.0F, 0.0F, -0.4F)));  // behind the camera
  EXPECT_FALSE(grid->Project(Eigen::Vector3f(0.4F, 0.0F, 0.4F)));   // far outside
}

TEST(GridProjection, FindsThePixelsOfParallelRays) {
  const RangeImage range = testing::MakePlaneView({}, 0).range;
  const auto grid = GridProjection::Fit(range);
  ASSERT_TRUE(grid);
  EXPECT_LT(WorstPixelError(range, *grid), 0.01);
}

TEST(GridProjection, RefusesCloudsThatAreNoGrid) {
  const RangeImage range = testing::MakePlaneView({}, 0).range;
  RangeImage row = MakeRangeImage(3600, 1);
  for (std::size_t i = 0; i < range.points.size(); ++i) row.points[i] = range.points[i];
  row.line_of_sight = range.line_of_sight;
  EXPECT_FALSE(GridProjection::Fit(row));
  RangeImage shuffled = range;
  for (std::size_t i = 0; i < range.points.size(); ++i) {
    shuffled.points[i] = range.points[(i * 1237) % range.points.size()];
  }
  EXPECT_FALSE(GridProjection::Fit(shuffled));
  EXPECT_FALSE(GridProjection::Fit(MakeRangeImage(60, 60)));  // all NaN
}

}  // namespace
}  // namespace fringe_fusion
