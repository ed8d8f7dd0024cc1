#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "common/constants.hpp"
#include "common/median.hpp"
#include "common/turn_place.hpp"
#include "exposures.hpp"
#include "fringe_fusion/diagnosis/response.hpp"
#include "response_light.hpp"
#include "stack_sampling.hpp"

namespace fringe_fusion {
namespace {

constexpr std::size_t kWaveSize = 4096;
constexpr std::size_t kLutSize = 1024;
constexpr std::size_t kNumWaveHarmonics = 32;
constexpr double kLeastContrast = 0.02;
// No picture is sharper; below 1 the harmonics beyond, the noise of a measured curve, are dropped.
constexpr double kMostContrast = 0.9999;
// Noise that a table multiplies by more than this is better avoided by more steps.
constexpr double kMaxLutSlope = 4.0;
// Where coarse fringes keep this share of their amplitude, grey values tell the response.
constexpr double kSharpContrast = 0.9;
constexpr std::size_t kMinContrastPixels = 100;

double PhaseOf(std::size_t i, std::size_t size) {
  return kTwoPi * static_cast<double>(i) / static_cast<double>(size);
}

/// Amplitudes of cos(k theta) in the light of a cosine pattern, k = 0 .. kNumWaveHarmonics.
std::vector<double> Amplitudes(const std::vector<double>& light,
                               const std::vector<double>& cosine) {
  std::vector<double> amplitudes(kNumWaveHarmonics + 1, 0.0);
  for (std::size_t k = 0; k < amplitudes.size(); ++k) {
    for (std::size_t i = 0; i < kWaveSize; ++i) {
      amplitudes[k] += light[i] * cosine[k * i % kWaveSize];
    }
    amplitudes[k] *= (k == 0 ? 1.0 : 2.0) / static_cast<double>(kWaveSize);
  }
  return amplitudes;
}

/// Shape of the fringes, and the amplitude of their cosine, of white minus black, without blur.
struct Wave {
  std::vector<double> shape;  ///< as PhaseLut::wave
  double amplitude_ratio = 0.5;
};

// A Gaussian blur leaves c^(k^2) of harmonic k where it leaves c of the first.
Wave MakeWave(const ResponseCurve& response, double contrast) {
  std::vector<double> cosine(kWaveSize);
  std::vector<double> light(kWaveSize);
  for (std::size_t i = 0; i < kWaveSize; ++i) {
    cosine[i] = std::cos(PhaseOf(i, kWaveSize));
    light[i] = diagnosis::SeenLight(response, 0.5 + 0.5 * cosine[i]);
  }
  const std::vector<double> amplitudes = Amplitudes(light, cosine);
  Wave wave{std::vector<double>(kWaveSize, 0.0), amplitudes[1]};
  if (!(contrast < 1.0)) {
    for (std::size_t i = 0; i < kWaveSize; ++i) {
      wave.shape[i] = (light[i] - amplitudes[0]) / amplitudes[1];
    }
    return wave;
  }
  const double kept = std::max(contrast, kLeastContrast);
  for (std::size_t k = 1; k < amplitudes.size(); ++k) {
    const double power = static_cast<double>(k) * static_cast<double>(k) - 1.0;
    const double part = amplitudes[k] / amplitudes[1] * std::pow(kept, power);
    for (std::size_t i = 0; i < kWaveSize; ++i) wave.shape[i] += part * cosine[k * i % kWaveSize];
  }
  return wave;
}

/// What N steps measure of true phases 2 pi i / size.
struct Measured {
  std::vector<double> phase_rad;  ///< unwrapped, made rising; one more entry closes the circle
  std::vector<double> amplitude_ratio;
};

Measured Measure(const std::vector<double>& wave, int steps) {
  Measured measured;
  for (std::size_t i = 0; i < kLutSize; ++i) {
    const double phase = PhaseOf(i, kLutSize);
    double sine = 0.0;
    double cosine = 0.0;
    for (int n = 0; n < steps; ++n) {
      const double delta = kTwoPi * n / steps;
      const double grey = TurnPlace(phase - delta, wave.size()).In(wave);
      sine += grey * std::sin(delta);
      cosine += grey * std::cos(delta);
    }
    const double error = std::remainder(std::atan2(sine, cosine) - phase, kTwoPi);
    const double before = i == 0 ? phase + error : measured.phase_rad.back();
    measured.phase_rad.push_back(std::max(phase + error, before));
    measured.amplitude_ratio.push_back(2.0 / steps * std::hypot(sine, cosine));
  }
  measured.phase_rad.push_back(
      std::max(measured.phase_rad.front() + kTwoPi, measured.phase_rad.back()));
  return measured;
}

/// Share of the amplitude that blur leaves of each set; kMostContrast where that cannot be told.
std::vector<double> MeasureContrasts(const diagnosis::SampledStack& stack,
                                     const diagnosis::SequencePlan& plan, double sharp_ratio) {
  std::vector<diagnosis::StepFit> fits;
  for (const diagnosis::StepSet& set : plan.sets) fits.push_back(FitSteps(stack, set));
  const bool has_light = !plan.white_frames.empty() && !plan.black_frames.empty();
  Image<float> white;
  Image<float> black;
  if (has_light) white = diagnosis::MeanOfFrames(stack, plan.white_frames);
  if (has_light) black = diagnosis::MeanOfFrames(stack, plan.black_frames);
  std::vector<double> contrasts;
  std::size_t coarsest = 0;
  for (std::size_t s = 0; s < fits.size(); ++s) {
    if (diagnosis::IsCoarsest(plan, s)) coarsest = s;
    const auto sharp = [&](std::size_t i) {
      if (!has_light) return static_cast<double>(fits[coarsest].modulation_dn[i]);
      const bool clipped = !(white[i] < diagnosis::kSaturationRatio * stack.full_scale_dn);
      return clipped ? 0.0 : sharp_ratio * static_cast<double>(white[i] - black[i]);
    };
    double brightest = 0.0;
    for (std::size_t i = 0; i < stack.size(); ++i) brightest = std::max(brightest, sharp(i));
    std::vector<double> ratios;
    for (std::size_t i = 0; i < stack.size(); ++i) {
      if (!(sharp(i) > 0.25 * brightest)) continue;
      ratios.push_back(static_cast<double>(fits[s].modulation_dn[i]) / sharp(i));
    }
    const bool told = ratios.size() >= kMinContrastPixels;
    const double contrast = told ? Median(std::move(ratios)) : kMostContrast;
    contrasts.push_back(std::min(contrast, kMostContrast));
  }
  return contrasts;
}

// Patterns that were corrected already show a straight response.
Status CheckOwnResponse(const ResponseCurve& response, const ImageStack& stack,
                        const diagnosis::SequencePlan& plan, const std::vector<double>& contrasts,
                        const DiagnosisConfig& config) {
  for (std::size_t s = 0; s < plan.sets.size(); ++s) {
    const bool looked_at = !diagnosis::IsFinest(plan, s) || diagnosis::IsCoarsest(plan, s);
    if (looked_at && !(contrasts[s] >= kSharpContrast)) return {};
  }
  const auto own = ResponseFromScan(stack, config);
  if (!own || std::abs(own->gamma - response.gamma) <= config.max_gamma_error) return {};
  return Fail(
      "phase: the scan's own response has gamma {:.2f}, the one to be undone {:.2f}, which may "
      "differ by {} (max_gamma_error): its patterns were corrected already, or the cell has "
      "changed",
      own->gamma, response.gamma, config.max_gamma_error);
}

}  // namespace

PhaseLut MakePhaseLut(const ResponseCurve& response, int steps, double contrast) {
  PhaseLut lut;
  lut.steps = steps;
  lut.wave = MakeWave(response, contrast).shape;
  const Measured measured = Measure(lut.wave, steps);
  const double first = measured.phase_rad.front();
  for (std::size_t j = 0; j < kLutSize; ++j) {
    double phase = PhaseOf(j, kLutSize);
    phase -= kTwoPi * std::floor((phase - first) / kTwoPi);  // into first .. first + 2 pi
    const auto above =
        std::upper_bound(measured.phase_rad.begin() + 1, measured.phase_rad.end() - 1, phase);
    const auto i = static_cast<std::size_t>(above - measured.phase_rad.begin()) - 1;
    const double width = measured.phase_rad[i + 1] - measured.phase_rad[i];
    const double part = width > 0.0 ? (phase - measured.phase_rad[i]) / width : 0.0;
    const double truth = PhaseOf(i, kLutSize) + part * kTwoPi / static_cast<double>(kLutSize);
    lut.error_rad.push_back(phase - truth);
    lut.amplitude_ratio.push_back(TurnPlace(truth, kLutSize).In(measured.amplitude_ratio));
  }
  const double two_places = 2.0 * kTwoPi / static_cast<double>(kLutSize);
  for (std::size_t j = 0; j < kLutSize; ++j) {
    const double after = lut.error_rad[(j + 1) % kLutSize];
    const double before = lut.error_rad[(j + kLutSize - 1) % kLutSize];
    lut.slope.push_back(1.0 - (after - before) / two_places);
  }
  return lut;
}

Result<PhaseCorrection> MakePhaseCorrection(const ResponseCurve& response, const ImageStack& whole,
                                            const DiagnosisConfig& config) {
  Status status = CheckBounds(config, "diagnosis");
  if (status) status = Validate(whole, "phase");
  if (status) status = CheckCorrectable(whole.sequence);
  if (!status) return tl::unexpected<Error>(status.error());
  auto sampled = diagnosis::SampleStack(whole, config.max_samples);
  if (!sampled) return Forward(sampled);
  std::optional<ImageStack> part;  // frames are many megabytes
  if (!diagnosis::IsOneExposure(whole.sequence)) {
    const double best = diagnosis::BestExposure(*sampled, whole, PhaseConfig{});
    part = diagnosis::OneExposure(whole, best);
    sampled = diagnosis::SampleStack(*part, config.max_samples);
    if (!sampled) return Forward(sampled);
  }
  const ImageStack& stack = part ? *part : whole;
  const diagnosis::SequencePlan plan = diagnosis::MakeSequencePlan(stack.sequence);
  const std::vector<double> contrasts =
      MeasureContrasts(*sampled, plan, MakeWave(response, 1.0).amplitude_ratio);
  status = CheckOwnResponse(response, stack, plan, contrasts, config);
  if (!status) return tl::unexpected<Error>(status.error());
  PhaseCorrection correction;
  for (std::size_t s = 0; s < plan.sets.size(); ++s) {
    const diagnosis::StepSet& set = plan.sets[s];
    const auto steps = static_cast<int>(set.frame_of_step.size());
    PhaseLut lut = MakePhaseLut(response, steps, contrasts[s]);
    const double steepest = *std::max_element(lut.slope.begin(), lut.slope.end());
    if (!(steepest <= kMaxLutSlope)) {
      return Fail(
          "phase: the response of gamma {:.2f} leaves places where the phase of the {} steps of "
          "{:g} fringes moves {:.1f} times less than the true one, limit {}: take more steps, or "
          "undo the response in the patterns",
          response.gamma, steps, set.fringes, steepest, kMaxLutSlope);
    }
    correction.sets.push_back({set.axis, set.fringes, std::move(lut)});
  }
  return correction;
}

Result<PhaseMap> DecodeWithResponse(const ImageStack& stack, const PhaseConfig& phase,
                                    const DiagnosisConfig& config,
                                    const std::optional<ResponseCurve>& response,
                                    const Progress& progress, PhaseMap recycled) {
  if (!response || response->use != ResponseUse::kPhase) {
    return DecodePhase(stack, phase, progress, std::move(recycled));
  }
  const auto correction = MakePhaseCorrection(*response, stack, config);
  if (!correction) return Forward(correction);
  return DecodeCorrectedPhase(stack, phase, *correction, progress, std::move(recycled));
}

}  // namespace fringe_fusion
