#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "common/constants.hpp"
#include "fringe_fusion/diagnosis/response.hpp"
#include "stack_sampling.hpp"

namespace fringe_fusion {
namespace {

constexpr int kMaxSamples = 40000;
constexpr double kMinExponent = 0.02;
constexpr double kMaxExponent = 5.0;

// Grey values of one set over full scale, and the true phase, where it is known.
struct SetSamples {
  std::vector<std::vector<double>> steps;
  std::vector<double> phase_rad;
};

Result<SetSamples> Sample(const GammaSet& set) {
  ImageStack stack;
  stack.frames = set.frames;
  if (set.frames.size() < 3) {
    return Fail("gamma: a set has {} frames, needs at least 3", set.frames.size());
  }
  const auto sampled = diagnosis::SampleStack(stack, kMaxSamples);
  if (!sampled) return Forward(sampled);
  if (set.phase_rad.width() != Width(set.frames.front()) ||
      set.phase_rad.height() != Height(set.frames.front())) {
    return Fail("gamma: the phase is {} x {}, but the frames are {} x {}", set.phase_rad.width(),
                set.phase_rad.height(), Width(set.frames.front()), Height(set.frames.front()));
  }
  SetSamples samples;
  samples.steps.resize(set.frames.size());
  for (int y = 0; y < sampled->height(); ++y) {
    for (int x = 0; x < sampled->width(); ++x) {
      const float phase = set.phase_rad(x * sampled->stride, y * sampled->stride);
      if (!std::isfinite(phase)) continue;
      samples.phase_rad.push_back(static_cast<double>(phase));
      for (std::size_t n = 0; n < samples.steps.size(); ++n) {
        samples.steps[n].push_back(
            static_cast<double>(sampled->frames[n](x, y) / sampled->full_scale_dn));
      }
    }
  }
  if (samples.phase_rad.size() < 100) {
    return Fail("gamma: the phase is known in {} sampled pixels, needs at least 100",
                samples.phase_rad.size());
  }
  return samples;
}

// Sum of squared phase errors about their mean when the grey values are raised to a power. The
// mean is free: where the phase is known from elsewhere it may be off by a constant.
double PhaseError(const SetSamples& set, double exponent) {
  std::vector<double> errors(set.phase_rad.size());
  const auto steps = static_cast<double>(set.steps.size());
  double sum_sine = 0.0;
  double sum_cosine = 0.0;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    double sine = 0.0;
    double cosine = 0.0;
    for (std::size_t n = 0; n < set.steps.size(); ++n) {
      const double value = std::pow(set.steps[n][i], exponent);
      sine += value * std::sin(kTwoPi * static_cast<double>(n) / steps);
      cosine += value * std::cos(kTwoPi * static_cast<double>(n) / steps);
    }
    errors[i] = std::atan2(sine, cosine) - set.phase_rad[i];
    sum_sine += std::sin(errors[i]);
    sum_cosine += std::cos(errors[i]);
  }
  const double mean = std::atan2(sum_sine, sum_cosine);
  double squares = 0.0;
  for (const double error : errors) squares += std::pow(std::remainder(error - mean, kTwoPi), 2);
  return squares;
}

// Golden section on the logarithm of the power.
double BestExponent(const std::vector<SetSamples>& sets) {
  const auto cost = [&](double log_exponent) {
    double sum = 0.0;
    for (const SetSamples& set : sets) sum += PhaseError(set, std::exp(log_exponent));
    return sum;
  };
  const double golden = 0.5 * (std::sqrt(5.0) - 1.0);
  double low = std::log(kMinExponent);
  double high = std::log(kMaxExponent);
  double left = high - golden * (high - low);
  double right = low + golden * (high - low);
  double cost_left = cost(left);
  double cost_right = cost(right);
  while (high - low > 1e-5) {
    if (cost_left < cost_right) {
      high = right;
      right = left;
      cost_right = cost_left;
      left = high - golden * (high - low);
      cost_left = cost(left);
    } else {
      low = left;
      left = right;
      cost_left = cost_right;
      right = low + golden * (high - low);
      cost_right = cost(right);
    }
  }
  return std::exp(0.5 * (low + high));
}

}  // namespace

Result<GammaEstimate> EstimateGamma(const std::vector<GammaTrial>& trials) {
  GammaEstimate estimate;
  double mean_gamma = 0.0;
  double mean_exponent = 0.0;
  for (const GammaTrial& trial : trials) {
    std::vector<SetSamples> sets;
    for (const GammaSet& set : trial.sets) {
      Result<SetSamples> samples = Sample(set);
      if (!samples) return Forward(samples);
      sets.push_back(std::move(*samples));
    }
    if (sets.empty()) return Fail("gamma: pattern gamma {} has no sets", trial.pattern_gamma);
    estimate.exponents.push_back(BestExponent(sets));
    mean_gamma += trial.pattern_gamma / static_cast<double>(trials.size());
    mean_exponent += estimate.exponents.back() / static_cast<double>(trials.size());
  }
  double gamma_squares = 0.0;
  double products = 0.0;
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const double apart = trials[i].pattern_gamma - mean_gamma;
    gamma_squares += apart * apart;
    products += apart * (estimate.exponents[i] - mean_exponent);
  }
  if (!(gamma_squares > 1e-6)) {
    return Fail("gamma: {} trials with one pattern gamma, needs two different ones", trials.size());
  }
  const double slope = products / gamma_squares;
  if (!(slope > 1e-3)) {
    return Fail(
        "gamma: the power of least phase error rises by {:.4f} per pattern gamma, must rise",
        slope);
  }
  estimate.gamma = mean_gamma + (1.0 - mean_exponent) / slope;
  return estimate;
}

}  // namespace fringe_fusion
