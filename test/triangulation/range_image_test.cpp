#include "fringe_fusion/triangulation/range_image.hpp"

#include <gtest/gtest.h>

namespace fringe_fusion {
namespace {

TEST(RangeImage, StartsInvalid) {
  RangeImage range = MakeRangeImage(4, 3);
  EXPECT_EQ(range.points.size(), 12U);
  EXPECT_EQ(CountValid(range), 0);
  range.points(1, 2) = Eigen::Vector3f(0.0F, 0.0F, 1.0F);
  EXPECT_TRUE(IsValid(range, 1, 2));
  EXPECT_FALSE(IsValid(range, 2, 1));
  EXPECT_EQ(CountValid(range), 1);
}

TEST(DirectionToCamera, PointsToTheCentreOrAlongTheBeam) {
  LineOfSight line_of_sight;
  line_of_sight.camera = Eigen::Vector3f(0.0F, 0.0F, 1.0F);
  const Eigen::Vector3f point(0.0F, 2.0F, 1.0F);
  EXPECT_TRUE(DirectionToCamera(line_of_sight, point).isApprox(-Eigen::Vector3f::UnitY()));
  line_of_sight.directional = true;
  EXPECT_TRUE(DirectionToCamera(line_of_sight, point).isApprox(Eigen::Vector3f::UnitZ()));
}

}  // namespace
}  // namespace fringe_fusion
