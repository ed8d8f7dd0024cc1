#include "fringe_fusion/diagnosis/response.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "common/constants.hpp"
#include "exposures.hpp"
#include "fringe_fusion/pattern/pattern_light.hpp"
#include "response_bins.hpp"
#include "response_light.hpp"
#include "stack_sampling.hpp"

namespace fringe_fusion {
namespace {

constexpr int kRampSamples = 200000;
constexpr double kRampSaturationRatio = 0.98;
constexpr std::size_t kMinParts = 4;  // fewer tell no spread

// The value whose light is nearest.
std::uint8_t ValueOfLight(const ResponseCurve& response, double light) {
  const auto above = std::lower_bound(response.light.begin(), response.light.end(), light);
  auto value = static_cast<std::size_t>(above - response.light.begin());
  value = std::min(value, std::size_t{255});
  if (value > 0 && light - response.light[value - 1] < response.light[value] - light) --value;
  return static_cast<std::uint8_t>(value);
}

// Power law nearest to the curve: Gauss-Newton on the sum of (light - x^gamma)^2.
void FitGamma(ResponseCurve& response) {
  double gamma = 1.0;
  double squares = 0.0;
  for (int iteration = 0; iteration < 50; ++iteration) {
    double normal = 0.0;
    double right = 0.0;
    squares = 0.0;
    for (int i = 1; i < 255; ++i) {
      const double x = i / 255.0;
      const double model = std::pow(x, gamma);
      const double slope = model * std::log(x);
      const double rest = response.light[static_cast<std::size_t>(i)] - model;
      normal += slope * slope;
      right += slope * rest;
      squares += rest * rest;
    }
    const double step = std::clamp(right / normal, -0.5, 0.5);
    gamma = std::clamp(gamma + step, 0.05, 20.0);
    if (std::abs(step) < 1e-12) break;
  }
  response.gamma = gamma;
  response.gamma_residual = std::sqrt(squares / 254.0);
}

// Spread of the gamma over the parts of the image: noise, and what differs from place to place.
double JackknifeSigma(const diagnosis::BinsOfParts& parts) {
  std::vector<double> gammas;
  for (std::size_t left_out = 0; left_out < parts.size(); ++left_out) {
    if (parts[left_out].empty()) continue;
    diagnosis::ResponseBins bins;
    for (std::size_t k = 0; k < parts.size(); ++k) {
      if (k != left_out) bins.Add(parts[k]);
    }
    Result<ResponseCurve> curve = bins.Curve();
    if (!curve) continue;
    FitGamma(*curve);
    gammas.push_back(curve->gamma);
  }
  const auto count = static_cast<double>(gammas.size());
  if (gammas.size() < kMinParts) return std::numeric_limits<double>::quiet_NaN();
  double mean = 0.0;
  for (const double gamma : gammas) mean += gamma / count;
  double squares = 0.0;
  for (const double gamma : gammas) squares += (gamma - mean) * (gamma - mean);
  return std::sqrt((count - 1.0) / count * squares);
}

// Response of the frames of one exposure.
Result<ResponseCurve> ResponseOfFrames(const ImageStack& stack, const DiagnosisConfig& config) {
  const auto sampled = diagnosis::SampleStack(stack, config.max_samples);
  if (!sampled) return Forward(sampled);
  const diagnosis::SequencePlan plan = diagnosis::MakeSequencePlan(stack.sequence);
  return diagnosis::FitResponse(diagnosis::CollectResponse(*sampled, plan));
}

// Black and white of every usable pixel of a ramp, as weights.
struct RampPixels {
  Image<float> black;
  Image<float> span;  ///< 0: left out
};

RampPixels FindRampPixels(const diagnosis::SampledStack& stack) {
  RampPixels pixels{stack.frames.front(), Image<float>(stack.width(), stack.height())};
  const Image<float>& white = stack.frames.back();
  float brightest = 0.0F;
  for (std::size_t i = 0; i < stack.size(); ++i) {
    pixels.span[i] = white[i] - pixels.black[i];
    if (white[i] > static_cast<float>(kRampSaturationRatio) * stack.full_scale_dn)
      pixels.span[i] = 0;
    brightest = std::max(brightest, pixels.span[i]);
  }
  for (float& span : pixels.span) {
    if (!(span > 0.25F * brightest)) span = 0.0F;
  }
  return pixels;
}

Status CheckRamp(const std::vector<int>& values, const std::vector<CapturedFrame>& frames) {
  if (values.size() != frames.size() || values.size() < 3) {
    return Fail("response: {} values and {} frames, needs the same number, at least 3",
                values.size(), frames.size());
  }
  if (values.front() != 0 || values.back() != 255 ||
      std::adjacent_find(values.begin(), values.end(), std::greater_equal<>()) != values.end()) {
    return Fail("response: values {} must rise from 0 to 255", fmt::join(values, ","));
  }
  return {};
}

}  // namespace

Result<ResponseCurve> diagnosis::FitResponse(const BinsOfParts& parts) {
  ResponseBins bins;
  for (const ResponseBins& part : parts) bins.Add(part);
  Result<ResponseCurve> response = bins.Curve();
  if (!response) return response;
  FitGamma(*response);
  response->sigma_gamma = JackknifeSigma(parts);
  return response;
}

ResponseCurve PowerResponse(double gamma) {
  ResponseCurve response;
  for (std::size_t i = 0; i < 256; ++i) {
    response.light[i] = std::pow(static_cast<double>(i) / 255.0, gamma);
  }
  response.gamma = gamma;
  return response;
}

Result<ResponseCurve> MeasureResponse(const std::vector<int>& values,
                                      const std::vector<CapturedFrame>& frames) {
  if (Status status = CheckRamp(values, frames); !status) {
    return tl::unexpected<Error>(status.error());
  }
  ImageStack ramp;
  ramp.frames = frames;
  const auto stack = diagnosis::SampleStack(ramp, kRampSamples);
  if (!stack) return Forward(stack);
  const RampPixels pixels = FindRampPixels(*stack);
  diagnosis::BinsOfParts bins{};
  for (std::size_t k = 0; k < values.size(); ++k) {
    for (std::size_t i = 0; i < stack->size(); ++i) {
      bins[diagnosis::PartOf(*stack, i)].Add(
          values[k] / 255.0, static_cast<double>(stack->frames[k][i] - pixels.black[i]),
          static_cast<double>(pixels.span[i]));
    }
  }
  return diagnosis::FitResponse(bins);
}

Result<ResponseCurve> ResponseFromScan(const ImageStack& stack, const DiagnosisConfig& config) {
  Status status = CheckBounds(config, "diagnosis");
  if (status) status = Validate(stack, "response");
  if (!status) return tl::unexpected<Error>(status.error());
  if (!diagnosis::IsOneExposure(stack.sequence)) {
    const auto sampled = diagnosis::SampleStack(stack, config.max_samples);
    if (!sampled) return Forward(sampled);
    const double best = diagnosis::BestExposure(*sampled, stack, PhaseConfig{});
    return ResponseOfFrames(diagnosis::OneExposure(stack, best), config);
  }
  return ResponseOfFrames(stack, config);
}

std::vector<double> Harmonics(const ResponseCurve& response, int count) {
  constexpr int kSamples = 4096;
  std::vector<double> harmonics(static_cast<std::size_t>(std::max(count, 2)), 0.0);
  for (int i = 0; i < kSamples; ++i) {
    const double theta = 2.0 * kPi * (i + 0.5) / kSamples;
    const double light = diagnosis::SeenLight(response, diagnosis::CosineLight(theta));
    for (std::size_t k = 0; k < harmonics.size(); ++k) {
      harmonics[k] += light * std::cos(static_cast<double>(k) * theta);
    }
  }
  const double first = harmonics[1];
  for (double& harmonic : harmonics) harmonic /= first;
  harmonics[0] *= 0.5;  // the mean, not an amplitude
  harmonics.resize(static_cast<std::size_t>(std::max(count, 0)));
  return harmonics;
}

double PhaseRipple(const ResponseCurve& response, int steps) {
  const PhaseLut lut = MakePhaseLut(response, steps);
  double largest = 0.0;
  for (const double error : lut.error_rad) largest = std::max(largest, std::abs(error));
  return largest;
}

Result<int> ChooseSteps(const ResponseCurve& response, double noise_ratio, int max_steps) {
  if (!(noise_ratio > 0.0) || !std::isfinite(noise_ratio) || max_steps < 3) {
    return Fail("steps: noise ratio {} must be positive and max_steps {} at least 3", noise_ratio,
                max_steps);
  }
  double ripple = 0.0;
  for (int steps = 3; steps <= max_steps; ++steps) {
    ripple = PhaseRipple(response, steps);
    if (ripple < std::sqrt(2.0 / steps) * noise_ratio / 3.0) return steps;
  }
  return Fail("steps: gamma {:.2f} leaves a ripple of {:.4f} rad at {} steps, limit {:.4f} rad",
              response.gamma, ripple, max_steps, std::sqrt(2.0 / max_steps) * noise_ratio / 3.0);
}

std::array<std::uint8_t, 256> InverseLut(const ResponseCurve& response) {
  std::array<std::uint8_t, 256> lut{};
  for (std::size_t wanted = 0; wanted < 256; ++wanted) {
    lut[wanted] = ValueOfLight(response, static_cast<double>(wanted) / 255.0);
  }
  return lut;
}

Image<std::uint8_t> RenderCorrectedPattern(const Pattern& pattern, int width, int height,
                                           const ResponseCurve& response) {
  const Image<float> light = PatternLight(pattern, width, height);
  Image<std::uint8_t> picture(width, height);
  for (std::size_t i = 0; i < picture.size(); ++i) {
    picture[i] = ValueOfLight(response, static_cast<double>(light[i]));
  }
  return picture;
}

Image<std::uint8_t> RenderCorrectedPattern(const Pattern& pattern, int width, int height,
                                           const PatternCorrection& correction) {
  return correction.response ? RenderCorrectedPattern(pattern, width, height, *correction.response)
                             : RenderPattern(pattern, width, height, correction.gamma);
}

}  // namespace fringe_fusion
