#include "fringe_fusion/diagnosis/sensor_noise.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

#include "chi_square.hpp"
#include "common/dense.hpp"
#include "noise_residuals.hpp"
#include "stack_sampling.hpp"

namespace fringe_fusion {
namespace {

using diagnosis::NoiseResidual;
using diagnosis::NoiseResiduals;

constexpr double kClipZ = 3.0;  // residuals beyond are edges in motion, dust, hot pixels
constexpr std::size_t kMinResiduals = 1000;

// Greatest common divisor of all differences of grey values: a camera may deliver 12 bits in words
// of 16 with the lower bits empty.
double GreySpacing(const diagnosis::SampledStack& stack) {
  const int first = static_cast<int>(stack.frames.front()[0]);
  int spacing = 0;
  for (const Image<float>& frame : stack.frames) {
    for (const float value : frame) {
      spacing = std::gcd(spacing, std::abs(static_cast<int>(value) - first));
      if (spacing == 1) return 1.0;
    }
  }
  return std::max(1, spacing);
}

// Coefficients: constant (read^2 + quantisation^2), gain, then one relative^2 per group.
struct TransferFit {
  Eigen::VectorXd coefficients;
  Eigen::MatrixXd covariance;
  std::vector<Eigen::Index> active;  ///< columns that were free
};

double Predict(const NoiseResidual& r, const Eigen::VectorXd& coefficients) {
  return r.constant * coefficients[0] + r.level_dn * coefficients[1] +
         r.b2_dn2 * coefficients[2 + r.group];
}

// Start: the same variance everywhere, from the median, which outliers do not move.
Eigen::VectorXd StartingPoint(const NoiseResiduals& residuals) {
  std::vector<double> ratios;
  ratios.reserve(residuals.values.size());
  for (const NoiseResidual& r : residuals.values) {
    const double median_ratio = diagnosis::ChiSquareLimit(0.0, r.dof) / r.dof;
    ratios.push_back(r.variance_dn2 / (r.constant * median_ratio));
  }
  const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), middle, ratios.end());
  Eigen::VectorXd start = Eigen::VectorXd::Zero(2 + residuals.num_groups);
  start[0] = std::max(*middle, 1e-6);
  return start;
}

// One weighted least-squares step: a variance of d degrees of freedom scatters by mu sqrt(2 / d).
TransferFit SolveStep(const NoiseResiduals& residuals, const Eigen::VectorXd& previous,
                      const std::vector<Eigen::Index>& active) {
  const auto size = static_cast<Eigen::Index>(active.size());
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(size);
  Eigen::VectorXd row(size);
  const double smallest = 1e-3 * previous[0];
  for (const NoiseResidual& r : residuals.values) {
    const double mean = std::max(Predict(r, previous), smallest);
    const double limit = diagnosis::ChiSquareLimit(kClipZ, r.dof);
    if (!(r.variance_dn2 * r.dof < limit * mean)) continue;
    for (Eigen::Index j = 0; j < size; ++j) {
      const Eigen::Index column = active[static_cast<std::size_t>(j)];
      row[j] = column == 0   ? r.constant
               : column == 1 ? r.level_dn
                             : (column == 2 + r.group ? r.b2_dn2 : 0.0);
    }
    const double weight = r.dof / (2.0 * mean * mean);
    // What the clipping takes from the mean.
    const double value = r.variance_dn2 / diagnosis::TruncatedChiSquareMean(limit, r.dof);
    normal.noalias() += weight * row * row.transpose();
    right += weight * value * row;
  }
  // Scaled to a unit diagonal: levels and squared amplitudes differ by orders of magnitude.
  const Eigen::VectorXd scale = normal.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * normal * scale.asDiagonal();
  const Eigen::VectorXd solution =
      scale.cwiseProduct(dense::SolveSymmetric(scaled, scale.cwiseProduct(right)));
  TransferFit fit;
  fit.active = active;
  fit.coefficients = Eigen::VectorXd::Zero(previous.size());
  for (Eigen::Index j = 0; j < size; ++j) {
    fit.coefficients[active[static_cast<std::size_t>(j)]] = solution[j];
  }
  fit.covariance = scale.asDiagonal() *
                   dense::SolveSymmetric(scaled, Eigen::MatrixXd::Identity(size, size)) *
                   scale.asDiagonal();
  return fit;
}

TransferFit FitTransfer(const NoiseResiduals& residuals) {
  std::vector<Eigen::Index> active(static_cast<std::size_t>(2 + residuals.num_groups));
  std::iota(active.begin(), active.end(), 0);
  TransferFit fit;
  fit.coefficients = StartingPoint(residuals);
  for (int iteration = 0; iteration < 8; ++iteration) {
    fit = SolveStep(residuals, fit.coefficients, active);
    // Variances are not negative: such a term is not there.
    std::vector<Eigen::Index> kept;
    for (const Eigen::Index column : active) {
      if (column == 0 || fit.coefficients[column] > 0.0) kept.push_back(column);
    }
    fit.coefficients = fit.coefficients.cwiseMax(0.0);
    if (iteration > 2) active = kept;
  }
  return fit;
}

double Covariance(const TransferFit& fit, Eigen::Index a, Eigen::Index b) {
  const auto find = [&](Eigen::Index column) {
    return std::find(fit.active.begin(), fit.active.end(), column) - fit.active.begin();
  };
  const Eigen::Index i = find(a);
  const Eigen::Index j = find(b);
  const auto size = static_cast<Eigen::Index>(fit.active.size());
  return i < size && j < size ? fit.covariance(i, j) : 0.0;
}

// Standard deviation of sqrt(x) for x of standard deviation sigma, finite at x = 0.
double RootSigma(double x, double sigma) {
  return sigma / (2.0 * std::sqrt(std::max({x, sigma, 1e-12})));
}

SensorNoise ToNoise(const NoiseResiduals& residuals, const TransferFit& fit, double spacing) {
  SensorNoise noise;
  const double floor = spacing * spacing / 12.0;
  const double read2 = std::max(0.0, fit.coefficients[0] - floor);
  const double var_read2 = Covariance(fit, 0, 0);
  const double var_gain = Covariance(fit, 1, 1);
  noise.quantisation_dn = std::sqrt(floor);
  noise.read_noise_dn = std::sqrt(read2);
  noise.sigma_read_noise_dn = RootSigma(read2, std::sqrt(var_read2));
  noise.gain_dn = fit.coefficients[1];
  noise.sigma_gain_dn = std::sqrt(var_gain);
  if (var_read2 > 0.0 && var_gain > 0.0) {
    noise.read_gain_correlation = Covariance(fit, 0, 1) / std::sqrt(var_read2 * var_gain);
  }
  for (const int group : residuals.finest_groups) {
    const Eigen::Index column = 2 + group;
    const double relative2 = fit.coefficients[column];
    if (!(std::sqrt(relative2) >= noise.relative_residual)) continue;
    noise.relative_residual = std::sqrt(relative2);
    noise.sigma_relative_residual =
        RootSigma(relative2, std::sqrt(Covariance(fit, column, column)));
  }
  noise.num_samples = static_cast<int>(residuals.values.size());
  return noise;
}

Status CheckResiduals(const NoiseResiduals& residuals) {
  if (residuals.values.size() < kMinResiduals) {
    return Fail("sensor noise: {} usable residuals, needs at least {} (light, N >= 4 or two sets)",
                residuals.values.size(), kMinResiduals);
  }
  double low = residuals.values.front().level_dn;
  double high = low;
  for (const NoiseResidual& r : residuals.values) {
    low = std::min(low, r.level_dn / r.constant);
    high = std::max(high, r.level_dn / r.constant);
  }
  if (!(high > 1.2 * low + 2.0)) {
    return Fail(
        "sensor noise: grey values range over {:.1f}..{:.1f} DN only, cannot tell read "
        "noise from gain",
        low, high);
  }
  return {};
}

}  // namespace

Result<SensorNoise> EstimateSensorNoise(const ImageStack& stack, const DiagnosisConfig& config) {
  Status status = CheckBounds(config, "diagnosis");
  if (status) status = Validate(stack, "sensor noise");
  if (!status) return tl::unexpected<Error>(status.error());
  const auto sampled = diagnosis::SampleStack(stack, config.max_samples);
  if (!sampled) return Forward(sampled);
  const diagnosis::SequencePlan plan = diagnosis::MakeSequencePlan(stack.sequence);
  const double spacing = GreySpacing(*sampled);
  SensorNoise noise;
  noise.read_noise_dn = spacing;
  // The distance from the ends of the scale needs the noise itself: two rounds settle it.
  for (int round = 0; round < 3; ++round) {
    const NoiseResiduals residuals = diagnosis::CollectNoiseResiduals(*sampled, plan, noise);
    status = CheckResiduals(residuals);
    if (!status) return tl::unexpected<Error>(status.error());
    noise = ToNoise(residuals, FitTransfer(residuals), spacing);
    if (!std::isfinite(noise.read_noise_dn) || !std::isfinite(noise.gain_dn)) {
      return Fail("sensor noise: the fit to {} residuals failed", residuals.values.size());
    }
  }
  return noise;
}

Result<PhaseConfig> WithSensorNoise(const PhaseConfig& phase, const ImageStack& stack,
                                    const DiagnosisConfig& config) {
  if (!config.estimate_noise) return phase;
  const Result<SensorNoise> noise = EstimateSensorNoise(stack, config);
  if (!noise) {
    return Fail("{}; state read_noise_dn and gain_dn and set estimate_noise to false",
                noise.error().message);
  }
  PhaseConfig estimated = phase;
  estimated.read_noise_dn = noise->read_noise_dn;
  estimated.gain_dn = noise->gain_dn;
  return estimated;
}

}  // namespace fringe_fusion
