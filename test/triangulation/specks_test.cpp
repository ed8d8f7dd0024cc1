#include <gtest/gtest.h>

#include <cmath>

#include "fringe_fusion/triangulation/range_image.hpp"

namespace fringe_fusion {
namespace {

void AddPatch(RangeImage& range, int x0, int y0, int size, int stride, float depth_m) {
  for (int y = y0; y < y0 + size; y += stride) {
    for (int x = x0; x < x0 + size; x += stride) {
      range.points(x, y) = {0.001F * static_cast<float>(x), 0.001F * static_cast<float>(y),
                            depth_m};
      range.normals(x, y) = -Eigen::Vector3f::UnitZ();
      range.sigma_range(x, y) = 1e-5F;
    }
  }
}

TEST(RemoveSpecks, KeepsSurfacesAndDropsIslands) {
  RangeImage range = MakeRangeImage(60, 40);
  AddPatch(range, 2, 2, 10, 1, 0.5F);
  AddPatch(range, 30, 5, 4, 1, 0.5F);
  const RangeImage out = RemoveSpecks(range, {});
  EXPECT_EQ(CountValid(out), 100);
  EXPECT_FALSE(IsValid(out, 31, 6));
  EXPECT_TRUE(std::isnan(out.sigma_range(31, 6)));
}

TEST(RemoveSpecks, ADepthStepSeparates) {
  RangeImage range = MakeRangeImage(60, 40);
  AddPatch(range, 2, 2, 10, 1, 0.5F);
  AddPatch(range, 12, 2, 4, 1, 0.6F);  // touches in the image, 0.1 m behind
  EXPECT_EQ(CountValid(RemoveSpecks(range, {})), 100);
}

TEST(RemoveSpecks, ASparseSurfaceHoldsTogether) {
  RangeImage range = MakeRangeImage(60, 40);
  AddPatch(range, 2, 2, 20, 2, 0.5F);
  EXPECT_EQ(CountValid(RemoveSpecks(range, {})), 100);
}

TEST(RemoveSpecks, ZeroSwitchesItOff) {
  RangeImage range = MakeRangeImage(60, 40);
  AddPatch(range, 30, 5, 1, 1, 0.5F);
  TriangulationConfig config;
  config.min_component_px = 0;
  EXPECT_EQ(CountValid(RemoveSpecks(range, config)), 1);
  EXPECT_EQ(CountValid(RemoveSpecks(MakeRangeImage(0, 0), {})), 0);
}

}  // namespace
}  // namespace fringe_fusion
