#include "gray_smoothing.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::decode {
namespace {

constexpr int kRowsPerChunk = 16;

// Weighted normal equations of c = p0 + p1 dx + p2 dy about the centre pixel.
struct PlaneSums {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  double squares = 0.0;
  int count = 0;

  void Add(double dx, double dy, double value, double weight) {
    const Eigen::Vector3d row(1.0, dx, dy);
    normal += weight * row * row.transpose();
    right += weight * value * row;
    squares += weight * value * value;
    ++count;
  }
};

PlaneSums SumWindow(const CoordinateImage& code, int x, int y, int radius, float max_step_px) {
  PlaneSums sums;
  const float centre = code.value_px(x, y);
  const float centre_sigma = code.sigma_px(x, y);
  for (int j = std::max(0, y - radius); j <= std::min(code.value_px.height() - 1, y + radius);
       ++j) {
    for (int i = std::max(0, x - radius); i <= std::min(code.value_px.width() - 1, x + radius);
         ++i) {
      const float value = code.value_px(i, j) - centre;
      const int distance = std::max(std::abs(i - x), std::abs(j - y));
      // Negated so that NaN fails.
      if (!(std::abs(value) <= max_step_px * static_cast<float>(distance))) continue;
      // Cells that lost their finest bits weigh less; relative to the centre, weights stay near 1.
      const double ratio = static_cast<double>(centre_sigma / code.sigma_px(i, j));
      sums.Add(i - x, j - y, static_cast<double>(value), ratio * ratio);
    }
  }
  return sums;
}

struct FittedCoordinate {
  float value_px;
  float sigma_px;
};

FittedCoordinate FitPixel(const CoordinateImage& code, int x, int y, int radius_px,
                          float max_step_px) {
  const FittedCoordinate raw{code.value_px(x, y), code.sigma_px(x, y)};
  if (!std::isfinite(raw.value_px)) return raw;
  const std::optional<LocalPlane> plane = FitLocalPlane(code, x, y, radius_px, max_step_px);
  if (!plane) return raw;
  const double cell_sigma = static_cast<double>(raw.sigma_px);
  // sqrt(12) sigma is the cell: slope in cells per camera pixel. Below one, pixels of the same
  // cell carry the same rounding error and count once.
  const double slope = plane->slope_px_px.norm() / (std::sqrt(12.0) * cell_sigma);
  const double sharing = 1.0 / std::clamp(slope, 1.0 / plane->count, 1.0);
  const double variance = std::max(cell_sigma * cell_sigma, plane->residual_px2) *
                          std::min(1.0, plane->leverage * sharing);
  return {static_cast<float>(static_cast<double>(raw.value_px) + plane->value_px),
          static_cast<float>(std::sqrt(variance))};
}

}  // namespace

std::optional<LocalPlane> FitLocalPlane(const CoordinateImage& code, int x, int y, int radius_px,
                                        float max_step_px) {
  const PlaneSums sums = SumWindow(code, x, y, radius_px, max_step_px);
  const int least_count = (2 * radius_px + 1) * (radius_px + 1);
  if (sums.count < least_count) return std::nullopt;
  Eigen::Matrix3d inverse;
  bool invertible = false;
  sums.normal.computeInverseWithCheck(inverse, invertible, 1e-9);
  if (!invertible) return std::nullopt;
  const Eigen::Vector3d plane = inverse * sums.right;
  LocalPlane out;
  out.value_px = plane[0];
  out.slope_px_px = plane.tail<2>();
  out.residual_px2 = std::max(0.0, sums.squares - plane.dot(sums.right)) / (sums.count - 3);
  out.leverage = inverse(0, 0);
  out.count = sums.count;
  return out;
}

CoordinateImage SmoothGrayCode(const CoordinateImage& code, int radius_px, float max_step_px) {
  CoordinateImage smooth = code;
  ParallelFor(code.value_px.height(), kRowsPerChunk, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < code.value_px.width(); ++x) {
        const FittedCoordinate fit = FitPixel(code, x, y, radius_px, max_step_px);
        smooth.value_px(x, y) = fit.value_px;
        smooth.sigma_px(x, y) = fit.sigma_px;
      }
    }
  });
  return smooth;
}

}  // namespace fringe_fusion::decode
