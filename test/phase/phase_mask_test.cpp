#include "src/phase/phase_mask.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace fringe_fusion::decode {
namespace {

constexpr auto kEdge = static_cast<std::uint8_t>(MaskReason::kEdge);

PhaseMap FlatMap() {
  PhaseMap map;
  map.width = 12;
  map.height = 9;
  map.u = map.sigma_u = map.offset = map.modulation = Image<float>(12, 9, 1.0F);
  map.mask = Image<std::uint8_t>(12, 9);
  for (int y = 0; y < 9; ++y) {
    for (int x = 0; x < 12; ++x) {
      map.u(x, y) = 3.0F * static_cast<float>(x);
      map.offset(x, y) = 100.0F;
      map.modulation(x, y) = 80.0F;
    }
  }
  return map;
}

TEST(MaskEdges, KeepsASlopeAndAStep) {
  PhaseMap map = FlatMap();
  for (int y = 0; y < 9; ++y) {
    for (int x = 6; x < 12; ++x) map.u(x, y) += 200.0F;
  }
  const PhaseMap out = MaskEdges(map, {});
  for (const std::uint8_t reason : out.mask) EXPECT_EQ(reason, 0);
}

TEST(MaskEdges, DropsAPixelBetweenTwoSurfaces) {
  PhaseMap map = FlatMap();
  for (int y = 0; y < 9; ++y) {
    map.u(6, y) += 100.0F;
    for (int x = 7; x < 12; ++x) map.u(x, y) += 200.0F;
  }
  const PhaseMap out = MaskEdges(map, {});
  EXPECT_EQ(out.mask(6, 4), kEdge);
  EXPECT_TRUE(std::isnan(out.u(6, 4)));
  EXPECT_TRUE(std::isnan(out.sigma_u(6, 4)));
  EXPECT_EQ(out.mask(5, 4), 0);
  EXPECT_EQ(out.mask(7, 4), 0);
}

TEST(MaskEdges, DropsABlendButNotADarkTexture) {
  PhaseMap map = FlatMap();
  map.modulation(3, 3) = 20.0F;  // two phases cancel, the light stays
  map.modulation(8, 5) = 20.0F;  // dark paint takes both alike
  map.offset(8, 5) = 25.0F;
  const PhaseMap out = MaskEdges(map, {});
  EXPECT_EQ(out.mask(3, 3), kEdge);
  EXPECT_EQ(out.mask(8, 5), 0);
}

TEST(MaskEdges, LeavesOtherReasonsAlone) {
  PhaseMap map = FlatMap();
  map.mask(4, 4) = static_cast<std::uint8_t>(MaskReason::kShadow);
  map.u(4, 4) = std::numeric_limits<float>::quiet_NaN();
  const PhaseMap out = MaskEdges(map, {});
  EXPECT_EQ(out.mask(4, 4), static_cast<std::uint8_t>(MaskReason::kShadow));
  EXPECT_EQ(out.mask(5, 4), 0);
}

}  // namespace
}  // namespace fringe_fusion::decode
