#include "src/phase/gray_smoothing.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace fringe_fusion::decode {
namespace {

const float kCellSigma = 1.0F / std::sqrt(12.0F);

CoordinateImage Stairs(double slope_x, double slope_y) {
  CoordinateImage code{Image<float>(60, 50), Image<float>(60, 50, kCellSigma)};
  for (int y = 0; y < 50; ++y) {
    for (int x = 0; x < 60; ++x) {
      code.value_px(x, y) = static_cast<float>(std::round(200.0 + slope_x * x + slope_y * y));
    }
  }
  return code;
}

TEST(SmoothGrayCode, TakesTheRoundingOut) {
  const CoordinateImage smooth = SmoothGrayCode(Stairs(0.63, 0.11), 2, 8.0F);
  double sum = 0.0;
  double predicted = 0.0;
  for (int y = 0; y < 50; ++y) {
    for (int x = 0; x < 60; ++x) {
      const double error =
          static_cast<double>(smooth.value_px(x, y)) - (200.0 + 0.63 * x + 0.11 * y);
      sum += error * error;
      predicted += std::pow(static_cast<double>(smooth.sigma_px(x, y)), 2);
    }
  }
  EXPECT_LT(std::sqrt(sum / 3000.0), 0.1);
  EXPECT_LT(sum, predicted);
}

// Pixels much smaller than cells: nothing averages out, and sigma stays that of the cell.
TEST(SmoothGrayCode, PromisesNothingOnFlatStairs) {
  const CoordinateImage smooth = SmoothGrayCode(Stairs(0.01, 0.0), 2, 8.0F);
  EXPECT_NEAR(smooth.sigma_px(20, 20), kCellSigma, 0.02F);
}

TEST(SmoothGrayCode, KeepsInvalidPixelsAndDepthSteps) {
  CoordinateImage code = Stairs(0.63, 0.11);
  code.value_px(10, 10) = std::numeric_limits<float>::quiet_NaN();
  for (int y = 0; y < 50; ++y) {
    for (int x = 30; x < 60; ++x) code.value_px(x, y) += 100.0F;
  }
  const CoordinateImage smooth = SmoothGrayCode(code, 2, 8.0F);
  EXPECT_TRUE(std::isnan(smooth.value_px(10, 10)));
  EXPECT_NEAR(smooth.value_px(29, 20), 200.0F + 0.63F * 29.0F + 0.11F * 20.0F, 0.6F);
  EXPECT_NEAR(smooth.value_px(30, 20), 300.0F + 0.63F * 30.0F + 0.11F * 20.0F, 0.6F);
}

}  // namespace
}  // namespace fringe_fusion::decode
