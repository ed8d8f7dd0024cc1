#include "gray_smoothing.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::decode {
namespace {

constexpr int kRowsPerChunk = 16;
constexpr double kTwoPi = 6.28318530717958647692;
constexpr int kNumHarmonics = 12;

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

// Mean of exp(2 pi i q d) over d = -radius .. radius.
double WindowMean(double q, int radius) {
  double sum = 1.0;
  for (int d = 1; d <= radius; ++d) sum += 2.0 * std::cos(kTwoPi * q * d);
  return sum / (2 * radius + 1);
}

// The rounding to cells is a sawtooth of the coordinate, sum_k sin(2 pi k u / cell) / (pi k), and
// the window takes its mean: what is left of harmonic k is its response at k times the slope.
double RoundingVariance(const Eigen::Vector2d& slope_cells, int radius) {
  double variance = 0.0;
  for (int k = 1; k <= kNumHarmonics; ++k) {
    const double response =
        WindowMean(k * slope_cells.x(), radius) * WindowMean(k * slope_cells.y(), radius);
    variance += response * response / (0.5 * kTwoPi * kTwoPi * k * k);
  }
  return variance;
}

/// RoundingVariance for all slopes, smoothed by the uncertainty of a slope that was itself fitted
/// to rounded values. Harmonics see the slope modulo one cell per pixel, and its sign does not
/// matter.
class RoundingTable {
 public:
  explicit RoundingTable(int radius) {
    const double sum_d2 = (2 * radius + 1) * radius * (radius + 1) * (2 * radius + 1) / 3.0;
    const double slope_sigma = std::sqrt(1.0 / 12.0 / sum_d2);
    // Gauss-Hermite: three nodes a side.
    const std::array<double, 3> nodes = {0.0, std::sqrt(3.0) * slope_sigma,
                                         -std::sqrt(3.0) * slope_sigma};
    const std::array<double, 3> weights = {2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0};
    for (int j = 0; j <= kNumSteps; ++j) {
      for (int i = 0; i <= kNumSteps; ++i) {
        const Eigen::Vector2d slope = Eigen::Vector2d(i, j) * (0.5 / kNumSteps);
        double sum = 0.0;
        for (std::size_t k = 0; k < 9; ++k) {
          const Eigen::Vector2d shift(nodes[k % 3], nodes[k / 3]);
          sum += weights[k % 3] * weights[k / 3] * RoundingVariance(slope + shift, radius);
        }
        values_.push_back(sum);
      }
    }
  }

  [[nodiscard]] double At(const Eigen::Vector2d& slope_cells) const {
    const auto index = [](double q) {
      const double folded = std::abs(q - std::round(q));
      return static_cast<std::size_t>(std::lround(folded * 2.0 * kNumSteps));
    };
    return values_[index(slope_cells.y()) * (kNumSteps + 1) + index(slope_cells.x())];
  }

 private:
  static constexpr int kNumSteps = 100;
  std::vector<double> values_;
};

FittedCoordinate FitPixel(const CoordinateImage& code, int x, int y, int radius_px,
                          float max_step_px, const RoundingTable& table) {
  const FittedCoordinate raw{code.value_px(x, y), code.sigma_px(x, y)};
  if (!std::isfinite(raw.value_px)) return raw;
  const std::optional<LocalPlane> plane = FitLocalPlane(code, x, y, radius_px, max_step_px);
  if (!plane) return raw;
  const double cell_px = std::sqrt(12.0) * static_cast<double>(raw.sigma_px);
  const double cell_variance = cell_px * cell_px / 12.0;
  // A window that lacks pixels takes its mean over fewer of them.
  const double full_count = (2 * radius_px + 1) * (2 * radius_px + 1);
  const double rounding =
      cell_px * cell_px * table.At(plane->slope_px_px / cell_px) * full_count / plane->count;
  // Rounding varies within the window or shifts it as a whole: codes that lie on a plane, as on a
  // flat stair, hide all of it.
  const bool hidden = plane->residual_px2 < 0.5 * cell_variance;
  const double common = hidden ? cell_variance - plane->residual_px2 : 0.0;
  // Residuals beyond the rounding are noise or curvature.
  const double excess = std::max(0.0, plane->residual_px2 - cell_variance) * plane->leverage;
  const double variance = std::min(cell_variance, std::max(rounding, common)) + excess;
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
  const RoundingTable table(radius_px);
  ParallelFor(code.value_px.height(), kRowsPerChunk, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < code.value_px.width(); ++x) {
        const FittedCoordinate fit = FitPixel(code, x, y, radius_px, max_step_px, table);
        smooth.value_px(x, y) = fit.value_px;
        smooth.sigma_px(x, y) = fit.sigma_px;
      }
    }
  });
  return smooth;
}

}  // namespace fringe_fusion::decode
