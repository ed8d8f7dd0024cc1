#include "src/phase/gray_smoothing.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace fringe_fusion::decode {
namespace {

const float kSmoothedCellSigma = 1.0F / std::sqrt(12.0F);

CoordinateImage Stairs(double slope_x, double slope_y) {
  CoordinateImage code{Image<float>(60, 50), Image<float>(60, 50, kSmoothedCellSigma)};
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
  EXPECT_LT(sum, 1.2 * predicted);
}

// Pixels much smaller than cells: nothing averages out, and sigma stays that of the cell.
TEST(SmoothGrayCode, PromisesNothingOnFlatStairs) {
  const CoordinateImage smooth = SmoothGrayCode(Stairs(0.01, 0.0), 2, 8.0F);
  EXPECT_NEAR(smooth.sigma_px(20, 20), kSmoothedCellSigma, 0.02F);
}

// Planes of all pairs of slopes, each at many places between the cells, side by side in one image.
class SlopeTiles {
 public:
  static constexpr int kNumPlaces = 25;
  static constexpr int kSide = 17;  // five pixels in the middle see no border

  SlopeTiles() {
    for (const double y : {0.0, 0.03, 0.07, 0.11, 0.2, 0.37}) {
      for (const double x :
           {0.02, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.93, 0.97, 1.0, 1.1, 1.25}) {
        slopes_.emplace_back(x, y);
      }
    }
  }

  [[nodiscard]] int count() const { return static_cast<int>(slopes_.size()); }
  [[nodiscard]] const Eigen::Vector2d& slope(int tile) const {
    return slopes_[static_cast<std::size_t>(tile)];
  }

  // Neighbouring tiles lie too far apart in value to be taken for one surface.
  [[nodiscard]] double Truth(int x, int y) const {
    const int place = x / kSide;
    const int tile = y / kSide;
    const double start = 300.0 * place + 150.0 * (tile % 2) + 0.6180339887 * place;
    const double wobble = 1e-4 * place;
    return start + (slope(tile).x() + wobble) * (x % kSide) +
           (slope(tile).y() - wobble) * (y % kSide);
  }

  [[nodiscard]] CoordinateImage Code() const {
    const int width = kSide * kNumPlaces;
    const int height = kSide * count();
    CoordinateImage code{Image<float>(width, height),
                         Image<float>(width, height, kSmoothedCellSigma)};
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        code.value_px(x, y) = static_cast<float>(std::round(Truth(x, y)));
      }
    }
    return code;
  }

  // rms of error / sigma in the middles of the tiles of one slope.
  [[nodiscard]] double ErrorOverSigma(const CoordinateImage& smooth, int tile) const {
    double squares = 0.0;
    int num_pixels = 0;
    for (int y = tile * kSide + 6; y < tile * kSide + 11; ++y) {
      for (int x = 0; x < smooth.value_px.width(); ++x) {
        if (x % kSide < 6 || x % kSide > 10) continue;
        const double error = static_cast<double>(smooth.value_px(x, y)) - Truth(x, y);
        squares += std::pow(error / static_cast<double>(smooth.sigma_px(x, y)), 2);
        ++num_pixels;
      }
    }
    return std::sqrt(squares / num_pixels);
  }

 private:
  std::vector<Eigen::Vector2d> slopes_;
};

// Slopes near whole cells per pixel, and near their simple fractions, lock in with the cells: there
// no window tells where in the cell the pixels lie, and the slope itself is in doubt.
TEST(SmoothGrayCode, StatesASigmaThatHoldsOverTheSlopes) {
  const SlopeTiles tiles;
  const CoordinateImage smooth = SmoothGrayCode(tiles.Code(), 2, 8.0F);
  double least = 10.0;
  double largest = 0.0;
  for (int tile = 0; tile < tiles.count(); ++tile) {
    const double ratio = tiles.ErrorOverSigma(smooth, tile);
    EXPECT_GT(ratio, 0.5) << tiles.slope(tile).transpose();
    EXPECT_LT(ratio, 1.45) << tiles.slope(tile).transpose();
    least = std::min(least, ratio);
    largest = std::max(largest, ratio);
  }
  RecordProperty("least_permille", static_cast<int>(1000.0 * least));
  RecordProperty("largest_permille", static_cast<int>(1000.0 * largest));
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
