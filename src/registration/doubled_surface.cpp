#include "fringe_fusion/registration/doubled_surface.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace fringe_fusion {
namespace {

constexpr std::size_t kMinResiduals = 100;
constexpr int kMaxIterations = 60;
constexpr double kMinFaceShare = 0.1;
constexpr double kMinSeparation = 3.0;

struct Normal {
  double share = 0.0;
  double mean = 0.0;
  double sigma = 0.0;
  [[nodiscard]] double Density(double x) const {
    const double z = (x - mean) / sigma;
    return share / sigma * std::exp(-0.5 * z * z);
  }
};

double MeanOf(const float* begin, const float* end) {
  double sum = 0.0;
  for (const float* at = begin; at != end; ++at) sum += static_cast<double>(*at);
  return sum / static_cast<double>(end - begin);
}

// Expectation maximisation from the halves below and above the median.
std::array<Normal, 2> FitTwo(const std::vector<float>& sorted, double sigma, double floor) {
  const float* begin = sorted.data();
  const float* middle = begin + sorted.size() / 2;
  const float* end = begin + sorted.size();
  std::array<Normal, 2> fit = {Normal{0.5, MeanOf(begin, middle), 0.6 * sigma},
                               Normal{0.5, MeanOf(middle, end), 0.6 * sigma}};
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    std::array<std::array<double, 3>, 2> sums{};
    for (const float value : sorted) {
      const auto x = static_cast<double>(value);
      const std::array<double, 2> p = {fit[0].Density(x), fit[1].Density(x)};
      const double total = p[0] + p[1];
      if (!(total > 0.0)) continue;
      for (std::size_t k = 0; k < 2; ++k) {
        sums[k][0] += p[k] / total;
        sums[k][1] += p[k] / total * x;
        sums[k][2] += p[k] / total * x * x;
      }
    }
    for (std::size_t k = 0; k < 2; ++k) {
      if (!(sums[k][0] > 1.0)) continue;
      fit[k].share = sums[k][0] / static_cast<double>(sorted.size());
      fit[k].mean = sums[k][1] / sums[k][0];
      const double variance = sums[k][2] / sums[k][0] - fit[k].mean * fit[k].mean;
      fit[k].sigma = std::max(floor, std::sqrt(std::max(0.0, variance)));
    }
  }
  return fit;
}

}  // namespace

std::optional<DoubledSurface> FindDoubledSurface(const std::vector<float>& residuals_m,
                                                 double sigma_m) {
  if (residuals_m.size() < kMinResiduals) return std::nullopt;
  std::vector<float> sorted = residuals_m;
  std::sort(sorted.begin(), sorted.end());
  const double mean = MeanOf(sorted.data(), sorted.data() + sorted.size());
  double squares = 0.0;
  for (const float x : sorted) {
    squares += (static_cast<double>(x) - mean) * (static_cast<double>(x) - mean);
  }
  const double sigma = std::sqrt(squares / static_cast<double>(sorted.size()));
  if (!(sigma > 0.0)) return std::nullopt;
  const std::array<Normal, 2> fit = FitTwo(sorted, sigma, 0.05 * sigma);
  const double distance = std::abs(fit[0].mean - fit[1].mean);
  const double spread = std::hypot(fit[0].sigma, fit[1].sigma);
  DoubledSurface doubled{distance, std::min(fit[0].share, fit[1].share)};
  const bool apart = distance * std::sqrt(2.0) >= kMinSeparation * spread;
  if (!(doubled.share >= kMinFaceShare) || !apart || !(distance >= 3.0 * sigma_m)) {
    return std::nullopt;
  }
  return doubled;
}

}  // namespace fringe_fusion
