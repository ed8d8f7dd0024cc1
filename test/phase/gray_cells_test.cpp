#include "src/phase/gray_cells.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace fringe_fusion::decode {
namespace {

const float kCellSigma = 1.0F / std::sqrt(12.0F);

// Every cell is seen by 3 x 2 camera pixels.
PhaseMap BlockMap() {
  PhaseMap map;
  map.width = 30;
  map.height = 20;
  map.u = map.v = Image<float>(30, 20);
  map.sigma_u = map.sigma_v = Image<float>(30, 20, kCellSigma);
  map.mask = Image<std::uint8_t>(30, 20);
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 30; ++x) {
      map.u(x, y) = static_cast<float>(100 + x / 3);
      map.v(x, y) = static_cast<float>(50 + y / 2);
    }
  }
  return map;
}

TEST(KeepOnePixelPerCell, MovesTheCellCentreToAPixel) {
  const PhaseMap out = KeepOnePixelPerCell(BlockMap(), GrayCode{}, GrayCode{}, {});
  EXPECT_EQ(std::count(out.mask.begin(), out.mask.end(), 0), 10 * 10);
  for (int y = 4; y < 16; ++y) {
    for (int x = 6; x < 24; ++x) {
      if (out.mask(x, y) != 0) {
        EXPECT_TRUE(std::isnan(out.u(x, y)));
        continue;
      }
      // The group of cell (i, j) has its middle at (3 i + 1, 2 j + 1/2).
      EXPECT_NEAR(static_cast<double>(out.u(x, y)), 100.0 + (x - 1.0) / 3.0, 0.02);
      EXPECT_NEAR(static_cast<double>(out.v(x, y)), 50.0 + (y - 0.5) / 2.0, 0.05);
      EXPECT_NEAR(out.sigma_u(x, y), kCellSigma / std::sqrt(6.0F), 1e-5F);
    }
  }
}

TEST(KeepOnePixelPerCell, SeparatesTwoSightsOfOneCell) {
  PhaseMap map = BlockMap();
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 3; ++x) map.u(x + 15, y + 10) = 100.0F;
    for (int x = 0; x < 3; ++x) map.v(x + 15, y + 10) = 50.0F;
  }
  const PhaseMap out = KeepOnePixelPerCell(map, GrayCode{}, GrayCode{}, {});
  EXPECT_EQ(std::count(out.mask.begin(), out.mask.end(), 0), 10 * 10);
}

TEST(KeepOnePixelPerCell, DropsCoarseReadingsAndKeepsReasons) {
  PhaseMap map = BlockMap();
  map.sigma_u(10, 10) = 2.0F * kCellSigma;
  map.u(13, 10) += 0.5F;  // the border of two cells
  map.mask(20, 10) = static_cast<std::uint8_t>(MaskReason::kShadow);
  map.u(20, 10) = std::nanf("");
  const PhaseMap out = KeepOnePixelPerCell(map, GrayCode{}, GrayCode{}, {});
  const auto doubtful = static_cast<std::uint8_t>(MaskReason::kDoubtfulOrder);
  EXPECT_EQ(out.mask(10, 10), doubtful);
  EXPECT_EQ(out.mask(13, 10), doubtful);
  EXPECT_EQ(out.mask(20, 10), static_cast<std::uint8_t>(MaskReason::kShadow));
}

}  // namespace
}  // namespace fringe_fusion::decode
