#include "normal_noise.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "kernel_sums.hpp"

namespace fringe_fusion::internal {
namespace {

// Square grid around the origin with running sums over a window of 2 half + 1 points.
class Grid {
 public:
  Grid(int reach, int half)
      : reach_(reach), half_(half), side_(2 * reach + 1), values_(Size(), 0.0) {}

  double& operator()(int x, int y) { return values_[Index(x, y)]; }

  // Sum over the window about every point; points beyond the grid are zero.
  [[nodiscard]] Grid Windowed() const { return Pass(1, side_).Pass(side_, 1); }

 private:
  [[nodiscard]] std::size_t Size() const {
    return static_cast<std::size_t>(side_) * static_cast<std::size_t>(side_);
  }
  [[nodiscard]] std::size_t Index(int x, int y) const {
    return static_cast<std::size_t>((y + reach_) * side_ + x + reach_);
  }
  [[nodiscard]] Grid Pass(int step, int line_step) const {
    Grid result(reach_, half_);
    for (int line = 0; line < side_; ++line) {
      for (int i = 0; i < side_; ++i) {
        double sum = 0.0;
        for (int j = std::max(0, i - half_); j <= std::min(side_ - 1, i + half_); ++j) {
          sum += values_[static_cast<std::size_t>(line * line_step + j * step)];
        }
        result.values_[static_cast<std::size_t>(line * line_step + i * step)] = sum;
      }
    }
    return result;
  }

  int reach_;
  int half_;
  int side_;
  std::vector<double> values_;
};

}  // namespace

double NormalNoiseFactor(double window, int order) {
  if (!(window > 0.0)) return 1.0;
  const double slope_share = order == 2 ? 0.5 : 1.0;
  constexpr double kStep = 0.1;
  // Beyond four widths the slopes are as good as exact.
  const int half = std::max(1, static_cast<int>(std::lround(std::min(window, 4.0) / kStep)));
  const int reach = static_cast<int>(static_cast<double>(kRadiusInWidths) / kStep) + half;
  const auto kernel = [](int x, int y) {
    const double r2 = kStep * kStep * (x * x + y * y);
    const double taper = 1.0 - r2 / static_cast<double>(kRadiusInWidths * kRadiusInWidths);
    return taper > 0.0 ? std::exp(-0.5 * r2) * taper * taper : 0.0;
  };
  Grid wx(reach, half);
  Grid wy(reach, half);
  Grid wr2(reach, half);
  for (int y = -reach; y <= reach; ++y) {
    for (int x = -reach; x <= reach; ++x) {
      wx(x, y) = kernel(x, y) * kStep * x;
      wy(x, y) = kernel(x, y) * kStep * y;
      wr2(x, y) = kernel(x, y) * kStep * kStep * (x * x + y * y);
    }
  }
  Grid box_x = wx.Windowed();
  Grid box_y = wy.Windowed();
  Grid box_r2 = wr2.Windowed();
  // Sum of x^2 over the window.
  double moment = 0.0;
  for (int i = -half; i <= half; ++i) moment += kStep * kStep * i * i * (2 * half + 1);
  double plain = 0.0;
  double fitted = 0.0;
  for (int y = -reach; y <= reach; ++y) {
    for (int x = -reach; x <= reach; ++x) {
      const double slope = kStep * x * box_x(x, y) + kStep * y * box_y(x, y) - box_r2(x, y);
      plain += std::pow(kernel(x, y), 2);
      fitted += std::pow(kernel(x, y) - slope_share * slope / moment, 2);
    }
  }
  return fitted / plain;
}

}  // namespace fringe_fusion::internal
