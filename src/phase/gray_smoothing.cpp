#include "gray_smoothing.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "common/constants.hpp"
#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::decode {
namespace {

constexpr int kRowsPerChunk = 16;
constexpr std::size_t kNumHarmonics = 12;

// A slope fitted to rounded values needs a long base: over a short one it locks in with the cells.
constexpr int kSlopeRadiusFactor = 3;

// Weighted normal equations of c = p0 + p1 dx + p2 dy about the centre pixel.
struct PlaneSums {
  double w = 0.0, wx = 0.0, wy = 0.0, wxx = 0.0, wxy = 0.0, wyy = 0.0;
  double wc = 0.0, wcx = 0.0, wcy = 0.0, wcc = 0.0;
  int count = 0;

  void Add(double dx, double dy, double value, double weight) {
    const double x = weight * dx;
    const double y = weight * dy;
    const double c = weight * value;
    w += weight;
    wx += x;
    wy += y;
    wxx += x * dx;
    wxy += x * dy;
    wyy += y * dy;
    wc += c;
    wcx += c * dx;
    wcy += c * dy;
    wcc += c * value;
    ++count;
  }

  [[nodiscard]] Eigen::Matrix3d Normal() const {
    Eigen::Matrix3d normal;
    normal << w, wx, wy, wx, wxx, wxy, wy, wxy, wyy;
    return normal;
  }
  [[nodiscard]] Eigen::Vector3d Right() const { return {wc, wcx, wcy}; }
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

/// Variance that the window leaves of the rounding, for all slopes. The rounding to cells is a
/// sawtooth of the coordinate, sum_k sin(2 pi k u / cell) / (pi k), and the window takes its mean:
/// what is left of harmonic k is its response at k times the slope, along x times along y. The
/// squares are smoothed by the uncertainty of a slope that was itself fitted to rounded values.
/// Harmonics see the slope modulo one cell per pixel, and its sign does not matter. Those beyond
/// kNumHarmonics count as independent from pixel to pixel.
class RoundingTable {
 public:
  explicit RoundingTable(int radius) {
    const int base = kSlopeRadiusFactor * radius;
    const double sum_d2 = (2 * base + 1) * base * (base + 1) * (2 * base + 1) / 3.0;
    const double slope_sigma = std::sqrt(1.0 / 12.0 / sum_d2);
    // Gauss-Hermite: three nodes.
    const std::array<double, 3> nodes = {0.0, std::sqrt(3.0) * slope_sigma,
                                         -std::sqrt(3.0) * slope_sigma};
    const std::array<double, 3> weights = {2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0};
    double rest = 1.0 / 12.0;
    for (std::size_t k = 0; k < kNumHarmonics; ++k) rest -= VarianceOfHarmonic(k);
    rest_ = rest / ((2 * radius + 1) * (2 * radius + 1));
    for (std::size_t i = 0; i < squares_.size(); ++i) {
      const double slope = 0.5 * static_cast<double>(i) / kNumSteps;
      for (std::size_t k = 0; k < kNumHarmonics; ++k) {
        for (std::size_t node = 0; node < 3; ++node) {
          const double response =
              WindowMean(static_cast<double>(k + 1) * (slope + nodes[node]), radius);
          squares_[i][k] += weights[node] * response * response;
        }
      }
    }
  }

  /// @return [cells^2].
  [[nodiscard]] double At(const Eigen::Vector2d& slope_cells) const {
    const Squares& along_x = squares_[Index(slope_cells.x())];
    const Squares& along_y = squares_[Index(slope_cells.y())];
    double variance = rest_;
    for (std::size_t k = 0; k < kNumHarmonics; ++k) {
      variance += along_x[k] * along_y[k] * VarianceOfHarmonic(k);
    }
    return variance;
  }

 private:
  static constexpr int kNumSteps = 100;
  using Squares = std::array<double, kNumHarmonics>;

  // [cells^2]; k counts from 0.
  static double VarianceOfHarmonic(std::size_t k) {
    const double frequency = kTwoPi * static_cast<double>(k + 1);
    return 2.0 / (frequency * frequency);
  }

  static std::size_t Index(double slope_cells) {
    const double folded = std::abs(slope_cells - std::round(slope_cells));
    return static_cast<std::size_t>(std::lround(folded * 2.0 * kNumSteps));
  }

  std::array<Squares, kNumSteps + 1> squares_{};
  double rest_ = 0.0;
};

FittedCoordinate FitPixel(const CoordinateImage& code, int x, int y, int radius_px,
                          float max_step_px, const RoundingTable& table) {
  const FittedCoordinate raw{code.value_px(x, y), code.sigma_px(x, y)};
  if (!std::isfinite(raw.value_px)) return raw;
  const std::optional<LocalPlane> plane = FitLocalPlane(code, x, y, radius_px, max_step_px);
  if (!plane) return raw;
  const std::optional<LocalPlane> wide =
      FitLocalPlane(code, x, y, kSlopeRadiusFactor * radius_px, max_step_px);
  const Eigen::Vector2d slope_px_px = wide ? wide->slope_px_px : plane->slope_px_px;
  const double cell_px = std::sqrt(12.0) * static_cast<double>(raw.sigma_px);
  const double cell_variance = cell_px * cell_px / 12.0;
  // A window that lacks pixels takes its mean over fewer of them, extrapolates, and the harmonics
  // that a whole window cancels come back.
  const int full_count = (2 * radius_px + 1) * (2 * radius_px + 1);
  double rounding =
      cell_px * cell_px * table.At(slope_px_px / cell_px) * full_count * plane->leverage;
  if (plane->count < full_count) rounding = std::max(rounding, cell_variance * plane->leverage);
  // Residuals beyond the rounding are noise or curvature.
  const double excess = std::max(0.0, plane->residual_px2 - cell_variance) * plane->leverage;
  const double variance = std::min(cell_variance, rounding) + excess;
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
  sums.Normal().computeInverseWithCheck(inverse, invertible, 1e-9);
  if (!invertible) return std::nullopt;
  const Eigen::Vector3d plane = inverse * sums.Right();
  LocalPlane out;
  out.value_px = plane[0];
  out.slope_px_px = plane.tail<2>();
  out.residual_px2 = std::max(0.0, sums.wcc - plane.dot(sums.Right())) / (sums.count - 3);
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
