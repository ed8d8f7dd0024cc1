#include "src/phase/phase_mask.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <tuple>
#include <vector>

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

std::vector<int> EdgeColumns(const PhaseMap& map, int y) {
  std::vector<int> columns;
  for (int x = 0; x < map.width; ++x) {
    if (map.mask(x, y) == kEdge) columns.push_back(x);
  }
  return columns;
}

TEST(MaskEdges, KeepsASlope) {
  const PhaseMap out = MaskEdges(FlatMap(), {});
  for (const std::uint8_t reason : out.mask) EXPECT_EQ(reason, 0);
}

TEST(MaskEdges, DropsBothSidesOfAStep) {
  PhaseMap map = FlatMap();
  for (int y = 0; y < 9; ++y) {
    for (int x = 6; x < 12; ++x) map.u(x, y) += 200.0F;
  }
  const PhaseMap out = MaskEdges(map, {});
  for (int y = 0; y < 9; ++y) EXPECT_EQ(EdgeColumns(out, y), std::vector<int>({5, 6}));
}

TEST(MaskEdges, DropsAPixelBetweenTwoSurfaces) {
  PhaseMap map = FlatMap();
  for (int y = 0; y < 9; ++y) {
    map.u(6, y) += 100.0F;  // in the middle: it does not bend
    for (int x = 7; x < 12; ++x) map.u(x, y) += 200.0F;
  }
  const PhaseMap out = MaskEdges(map, {});
  EXPECT_EQ(EdgeColumns(out, 4), std::vector<int>({5, 6, 7}));
  EXPECT_TRUE(std::isnan(out.u(6, 4)));
  EXPECT_TRUE(std::isnan(out.sigma_u(6, 4)));
}

TEST(MaskEdges, FindsStepsAcrossRowsToo) {
  PhaseMap map = FlatMap();
  for (int y = 5; y < 9; ++y) {
    for (int x = 0; x < 12; ++x) map.u(x, y) += 30.0F;
  }
  const PhaseMap out = MaskEdges(map, {});
  for (int y = 0; y < 9; ++y) {
    EXPECT_EQ(EdgeColumns(out, y).size(), y == 4 || y == 5 ? 12U : 0U) << y;
  }
}

// Both limits have to be exceeded: one of length, one of noise.
TEST(MaskEdges, TakesNoiseForNoEdge) {
  for (const auto& [bump_px, sigma_px, is_edge] :
       {std::tuple<float, float, bool>{0.2F, 0.01F, false},
        {1.0F, 1.0F, false},
        {1.0F, 0.1F, true}}) {
    PhaseMap map = FlatMap();
    map.sigma_u = Image<float>(12, 9, sigma_px);
    map.u(5, 4) += bump_px;
    EXPECT_EQ(MaskEdges(map, {}).mask(5, 4) == kEdge, is_edge) << bump_px << ' ' << sigma_px;
  }
}

TEST(MaskEdges, DropsTheNeighboursOfPixelsWithoutLight) {
  PhaseMap map = FlatMap();
  map.mask(4, 4) = static_cast<std::uint8_t>(MaskReason::kShadow);
  map.mask(9, 4) = static_cast<std::uint8_t>(MaskReason::kSaturated);
  map.u(4, 4) = map.u(9, 4) = std::numeric_limits<float>::quiet_NaN();
  const PhaseMap out = MaskEdges(map, {});
  for (const int y : {3, 5}) EXPECT_EQ(EdgeColumns(out, y), std::vector<int>({3, 4, 5}));
  EXPECT_EQ(EdgeColumns(out, 4), std::vector<int>({3, 5}));
  EXPECT_EQ(out.mask(4, 4), static_cast<std::uint8_t>(MaskReason::kShadow));
  PhaseConfig config;
  config.mask_beside_dark = false;
  for (int y = 0; y < 9; ++y) EXPECT_TRUE(EdgeColumns(MaskEdges(map, config), y).empty());
}

// Bit by bit over words of 64, chunks of 32 rows and one axis alone: by the plain definition.
TEST(MaskEdges, EqualsThePlainDefinitionOnAnySize) {
  for (const int width : {1, 7, 64, 129}) {
    for (const int height : {1, 3, 33, 70}) {
      PhaseMap map;
      map.width = width;
      map.height = height;
      map.v = map.sigma_v = Image<float>(width, height, 0.1F);
      map.mask = Image<std::uint8_t>(width, height);
      std::mt19937 engine(7);
      for (std::size_t i = 0; i < map.v.size(); ++i) {
        map.v[i] = static_cast<float>(engine() % 16U == 0 ? 5 : 0);
        map.mask[i] = static_cast<std::uint8_t>(engine() % 64U == 0 ? 1 + engine() % 8U : 0);
        if (map.mask[i] != 0) map.v[i] = std::numeric_limits<float>::quiet_NaN();
      }
      const PhaseMap out = MaskEdges(map, {});
      const auto at = [&](int x, int y) {
        return map.v.Contains(x, y) ? map.v(x, y) : std::numeric_limits<float>::quiet_NaN();
      };
      const auto bends = [&](int x, int y) {
        const float twice = 2.0F * at(x, y);
        return std::abs(at(x - 1, y) + at(x + 1, y) - twice) > 1.3F ||
               std::abs(at(x, y - 1) + at(x, y + 1) - twice) > 1.3F;
      };
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
          bool edge = bends(x, y) || (bends(x - 1, y) && bends(x + 1, y));
          for (int k = 0; k < 9; ++k) {
            const int i = x + k % 3 - 1;
            const int j = y + k / 3 - 1;
            if (!map.mask.Contains(i, j)) continue;
            const int reason = map.mask(i, j);
            edge = edge || reason == 1 || reason == 2 || reason == 7 || reason == 8;
          }
          const int expected = map.mask(x, y) != 0 ? map.mask(x, y) : (edge ? kEdge : 0);
          ASSERT_EQ(out.mask(x, y), expected) << width << " x " << height << ' ' << x << ' ' << y;
        }
      }
    }
  }
}

}  // namespace
}  // namespace fringe_fusion::decode
