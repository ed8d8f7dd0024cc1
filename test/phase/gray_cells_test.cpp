#include "src/phase/gray_cells.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

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
      // Three pixels beside each other leave a third of the cell open, two above each other half.
      EXPECT_NEAR(out.sigma_u(x, y), kCellSigma / 3.0F, 0.01F);
      EXPECT_NEAR(out.sigma_v(x, y), kCellSigma / 2.0F, 0.01F);
    }
  }
}

// rms error over sigma of u on planes of a slope [cells per pixel], turned by an angle.
double ErrorOverSigma(double slope, double angle) {
  double sum = 0.0;
  int count = 0;
  for (int k = 0; k < 12; ++k) {
    PhaseMap map;
    map.width = map.height = 60;
    map.u = map.v = Image<float>(60, 60);
    map.sigma_u = map.sigma_v = Image<float>(60, 60, kCellSigma);
    map.mask = Image<std::uint8_t>(60, 60);
    const double a = slope * std::cos(angle);
    const double b = slope * std::sin(angle);
    const auto u = [&](int x, int y) { return 100.0 + 0.618 * k + (a + 1e-4 * k) * x + b * y; };
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 60; ++x) {
        map.u(x, y) = std::round(static_cast<float>(u(x, y)));
        map.v(x, y) = std::round(static_cast<float>(100.0 + 0.414 * k - 0.9 * (b * x - a * y)));
      }
    }
    const PhaseMap out = KeepOnePixelPerCell(std::move(map), GrayCode{}, GrayCode{}, {});
    for (int y = 10; y < 50; ++y) {
      for (int x = 10; x < 50; ++x) {
        if (out.mask(x, y) != 0) continue;
        const double error = static_cast<double>(out.u(x, y)) - u(x, y);
        sum += std::pow(error / static_cast<double>(out.sigma_u(x, y)), 2);
        ++count;
      }
    }
  }
  return std::sqrt(sum / count);
}

TEST(KeepOnePixelPerCell, StatesASigmaThatHoldsOverTheSlopes) {
  double least = 10.0;
  double largest = 0.0;
  for (const double angle : {0.0, 0.05, 0.2, 0.5}) {
    for (const double slope : {0.15, 0.25, 0.33, 0.42, 0.5, 0.6, 0.7, 0.8, 0.93, 1.0, 1.15, 1.4}) {
      const double ratio = ErrorOverSigma(slope, angle);
      EXPECT_GT(ratio, 0.4) << slope << ' ' << angle;
      EXPECT_LT(ratio, 1.4) << slope << ' ' << angle;
      least = std::min(least, ratio);
      largest = std::max(largest, ratio);
    }
  }
  RecordProperty("least_permille", static_cast<int>(1000.0 * least));
  RecordProperty("largest_permille", static_cast<int>(1000.0 * largest));
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
