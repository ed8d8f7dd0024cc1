#include "fringe_fusion/diagnosis/capture_assistant.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <map>
#include <utility>

#include "capture_predictor.hpp"
#include "common/constants.hpp"
#include "fringe_sets.hpp"

namespace fringe_fusion {
namespace {

using diagnosis::CapturePredictor;

constexpr int kMaxSteps = 64;  // of pattern.yaml
constexpr int kMinFinest = 4;  // fewer fringes are never worth it
constexpr double kFinestRatio = 1.12;
constexpr double kExposureRatio = 1.4142135623730951;

double Seconds(const CaptureSettings& settings, double overhead_s) {
  double each = 0.0;
  for (const double t : settings.exposures_s) each += t + overhead_s;
  return each * NumFrames(settings) / static_cast<double>(settings.exposures_s.size());
}

int NumAxes(const CaptureSettings& settings) {
  return static_cast<int>(settings.axis_u) + static_cast<int>(settings.axis_v);
}

// Three digits are enough for people and for cameras.
double RoundExposure(double exposure_s) {
  const double unit = std::pow(10.0, std::floor(std::log10(exposure_s)) - 2.0);
  return std::round(exposure_s / unit) * unit;
}

/// Exposure times that may be proposed.
class ExposureGrid {
 public:
  explicit ExposureGrid(const CaptureAssistantConfig& config) : config_(config) {
    for (double t = config.min_exposure_s; t <= config.max_exposure_s * 1.0001;
         t *= kExposureRatio) {
      const double allowed = Allowed(t);
      if (IsWithin(allowed) && (times_.empty() || allowed > times_.back())) {
        times_.push_back(allowed);
      }
    }
  }

  [[nodiscard]] double Allowed(double exposure_s) const {
    const double step = config_.exposure_step_s;
    return step > 0.0 ? step * std::max(1.0, std::round(exposure_s / step))
                      : RoundExposure(exposure_s);
  }
  [[nodiscard]] bool IsWithin(double exposure_s) const {
    return exposure_s >= config_.min_exposure_s * 0.999 &&
           exposure_s <= config_.max_exposure_s * 1.001;
  }
  [[nodiscard]] std::vector<std::vector<double>> Sets() const {
    std::vector<std::vector<double>> sets;
    for (std::size_t i = 0; i < times_.size(); ++i) {
      sets.push_back({times_[i]});
      for (std::size_t j = i + 2; j < times_.size() && config_.max_exposures >= 2; ++j) {
        sets.push_back({times_[i], times_[j]});
        const std::size_t k = 2 * j - i;
        if (config_.max_exposures >= 3 && k < times_.size()) {
          sets.push_back({times_[i], times_[j], times_[k]});
        }
      }
    }
    return sets;
  }

 private:
  const CaptureAssistantConfig& config_;
  std::vector<double> times_;
};

/// Compares ways to capture one scene.
class Search {
 public:
  Search(const CaptureScene& scene, const PhaseConfig& phase, const CaptureAssistantConfig& config,
         const CaptureBudget& budget)
      : scene_(scene),
        config_(config),
        budget_(budget),
        grid_(config),
        predictor_(scene, phase, config) {}

  void Run() {
    const std::vector<std::vector<double>> exposures = grid_.Sets();
    for (const bool use_v : {false, true}) {
      const bool both = config_.both_axes;
      if (both && use_v) break;
      if (!both && !Sees(use_v ? 1 : 0)) continue;
      CaptureSettings settings;
      settings.axis_u = both || !use_v;
      settings.axis_v = both || use_v;
      PrepareCodes(settings);
      for (const std::vector<double>& times : exposures) {
        settings.exposures_s = times;
        TryCodes(settings);
      }
    }
    if (std::isfinite(best_.prediction.sigma_depth_m)) Refine();
  }

  [[nodiscard]] const CaptureProposal& best() const { return best_; }

 private:
  // An axis that hardly moves with the depth is never the better one.
  [[nodiscard]] bool Sees(int axis) const {
    double own = 0.0;
    double other = 0.0;
    for (const CaptureScene::Pixel& pixel : scene_.pixels) {
      own += std::abs(pixel.px_per_m[axis]);
      other += std::abs(pixel.px_per_m[1 - axis]);
    }
    return own > 0.3 * other;
  }

  void PrepareCodes(const CaptureSettings& settings) {
    codes_.clear();
    int size_px = std::numeric_limits<int>::max();
    if (settings.axis_u) size_px = std::min(size_px, scene_.size_px[0]);
    if (settings.axis_v) size_px = std::min(size_px, scene_.size_px[1]);
    const int main_axis = settings.axis_u ? 0 : 1;
    const auto transfer = [&](double f) { return predictor_.Transfer(main_axis, f); };
    const int largest = static_cast<int>(size_px / config_.min_period_px);
    for (int finest = kMinFinest; finest <= largest;
         finest = std::max(finest + 1, static_cast<int>(std::lround(finest * kFinestRatio)))) {
      for (int count = 2; count <= config_.max_frequencies; ++count) {
        for (auto& set : diagnosis::FringeSets(finest, count, transfer)) {
          codes_[count].push_back(std::move(set));
        }
      }
    }
  }

  // More steps are always better: as many as the budget has.
  [[nodiscard]] int StepsFor(const CaptureSettings& settings, int num_frequencies) const {
    const auto num_exposures = static_cast<double>(settings.exposures_s.size());
    double each = budget_.frames / num_exposures;
    if (budget_.frames == 0) {
      double seconds = 0.0;
      for (const double t : settings.exposures_s) seconds += t + scene_.frame_overhead_s;
      each = budget_.seconds / seconds;
    }
    const double steps = (each + 1e-9 - 2.0) / (NumAxes(settings) * num_frequencies);
    return steps < 1.0 ? 0 : std::min(kMaxSteps, static_cast<int>(steps));
  }

  void TryCodes(CaptureSettings& settings) {
    for (const auto& [count, sets] : codes_) {
      settings.steps = StepsFor(settings, count);
      if (settings.steps < 3) continue;
      for (const std::vector<double>& fringes : sets) {
        settings.fringes = fringes;
        Try(settings);
      }
    }
  }

  bool Try(const CaptureSettings& settings) {
    const CapturePrediction prediction = predictor_.Run(settings, best_.prediction.sigma_depth_m);
    ++best_.num_compared;
    if (!(prediction.sigma_depth_m < best_.prediction.sigma_depth_m)) return false;
    best_.settings = settings;
    best_.prediction = prediction;
    return true;
  }

  // Exposure times between those of the grid, for the best code.
  void Refine() {
    for (double ratio = 1.19; ratio > 1.02; ratio = std::sqrt(ratio)) {
      for (bool better = true; better;) {
        better = false;
        for (std::size_t e = 0; e < best_.settings.exposures_s.size(); ++e) {
          better = TryExposure(e, ratio) || TryExposure(e, 1.0 / ratio) || better;
        }
      }
    }
  }

  bool TryExposure(std::size_t e, double ratio) {
    CaptureSettings settings = best_.settings;
    double& exposure_s = settings.exposures_s[e];
    exposure_s = grid_.Allowed(exposure_s * ratio);
    const bool rises = std::adjacent_find(settings.exposures_s.begin(), settings.exposures_s.end(),
                                          std::greater_equal<>()) == settings.exposures_s.end();
    if (!grid_.IsWithin(exposure_s) || !rises) return false;
    settings.steps = StepsFor(settings, static_cast<int>(settings.fringes.size()));
    return settings.steps >= 3 && Try(settings);
  }

  const CaptureScene& scene_;
  const CaptureAssistantConfig& config_;
  const CaptureBudget& budget_;
  ExposureGrid grid_;
  CapturePredictor predictor_;
  std::map<int, std::vector<std::vector<double>>> codes_;  ///< by the number of frequencies
  CaptureProposal best_{{}, {kInfinity, 0.0, 0.0, 0.0, 0.0}, 0, 0.0, 0, {}};
};

Status CheckScene(const CaptureScene& scene) {
  if (scene.pixels.empty()) return Fail("capture assistant: the scene has no pixel");
  if (scene.size_px[0] < 1 || scene.size_px[1] < 1) {
    return Fail("capture assistant: projector of {} x {} px", scene.size_px[0], scene.size_px[1]);
  }
  return {};
}

std::vector<std::string> Notes(const CaptureScene& scene, const CaptureProposal& proposal,
                               const CaptureAssistantConfig& config) {
  std::vector<std::string> notes;
  if (!scene.measured_noise) {
    notes.emplace_back(
        "the sensor noise is that of phase.yaml: no test exposure has N-step sets that tell it");
  }
  if (!scene.measured_fringes) {
    notes.push_back(
        fmt::format("a blur of {:g} px is assumed: add fringes to the test exposures to measure it",
                    config.blur_px));
  }
  if (scene.saturated_ratio > 0.5 * (1.0 - config.covered_ratio)) {
    notes.push_back(
        fmt::format("{:.1f} % of the visible surface is saturated at the shortest test exposure of "
                    "{:g} s: test "
                    "a shorter one",
                    100.0 * scene.saturated_ratio, scene.shortest_exposure_s));
  }
  const CapturePrediction& prediction = proposal.prediction;
  const double noise_rad = std::sqrt(2.0 / proposal.settings.steps) * prediction.noise_ratio;
  if (prediction.ripple_rad > noise_rad / 3.0) {
    notes.push_back(fmt::format(
        "gamma {:.2f} leaves a ripple of {:.4f} rad at {} steps, limit {:.4f} rad (a third of the "
        "phase noise): correct the response in the pattern",
        scene.response.gamma, prediction.ripple_rad, proposal.settings.steps, noise_rad / 3.0));
  }
  if (proposal.settings.exposures_s.back() > 0.99 * config.max_exposure_s) {
    notes.push_back(fmt::format(
        "the longest exposure allowed, {:g} s, is used: more light or a longer one would help",
        config.max_exposure_s));
  }
  return notes;
}

}  // namespace

Status Validate(const CaptureBudget& budget) {
  const bool frames = budget.frames > 0 && budget.seconds == 0.0;
  const bool seconds = budget.frames == 0 && budget.seconds > 0.0 && std::isfinite(budget.seconds);
  if (frames || seconds) return {};
  return Fail("capture budget: {} frames and {:g} s, exactly one must be positive", budget.frames,
              budget.seconds);
}

int NumFrames(const CaptureSettings& settings) {
  const int codes = NumAxes(settings) * static_cast<int>(settings.fringes.size());
  return static_cast<int>(settings.exposures_s.size()) * (2 + codes * settings.steps);
}

PatternConfig ToPatternConfig(const CaptureSettings& settings) {
  PatternConfig pattern;
  pattern.axis_u = settings.axis_u;
  pattern.axis_v = settings.axis_v;
  pattern.steps = settings.steps;
  pattern.fringes = fmt::format("{:g}", fmt::join(settings.fringes, ","));
  std::vector<double> ratios;
  for (const double t : settings.exposures_s) ratios.push_back(t / settings.exposures_s.front());
  pattern.exposures = fmt::format("{:.10g}", fmt::join(ratios, ","));
  return pattern;
}

Result<CapturePrediction> PredictCapture(const CaptureScene& scene, const CaptureSettings& settings,
                                         const PhaseConfig& phase,
                                         const CaptureAssistantConfig& config) {
  Status status = CheckBounds(config, "capture_assistant");
  if (status) status = CheckBounds(phase, "phase");
  if (status) status = CheckScene(scene);
  if (!status) return tl::unexpected<Error>(status.error());
  if (settings.exposures_s.empty() || !(settings.exposures_s.front() > 0.0)) {
    return Fail("capture settings: exposure times must be positive");
  }
  if (settings.fringes.size() < 2) {
    return Fail("capture settings: {} frequencies, at least 2 tell every place apart",
                settings.fringes.size());
  }
  const auto valid = MakeSequence(ToPatternConfig(settings), scene.size_px[0], scene.size_px[1]);
  if (!valid) return Forward(valid);
  return CapturePredictor(scene, phase, config).Run(settings, kInfinity);
}

Result<CaptureProposal> ProposeCapture(const CaptureScene& scene, const PhaseConfig& phase,
                                       const CaptureAssistantConfig& config,
                                       const CaptureBudget& budget) {
  Status status = CheckBounds(config, "capture_assistant");
  if (status) status = CheckBounds(phase, "phase");
  if (status) status = Validate(budget);
  if (status) status = CheckScene(scene);
  if (!status) return tl::unexpected<Error>(status.error());
  if (!(config.min_exposure_s <= config.max_exposure_s)) {
    return Fail("capture_assistant: min_exposure_s = {:g} must not exceed max_exposure_s = {:g}",
                config.min_exposure_s, config.max_exposure_s);
  }
  Search search(scene, phase, config, budget);
  search.Run();
  CaptureProposal proposal = search.best();
  if (proposal.num_compared == 0) {
    return Fail(
        "capture budget of {}: no code fits; the least is white, black and two frequencies of 3 "
        "steps per axis at an exposure within [{:g}, {:g}] s",
        budget.frames > 0 ? fmt::format("{} frames", budget.frames)
                          : fmt::format("{:g} s", budget.seconds),
        config.min_exposure_s, config.max_exposure_s);
  }
  if (!std::isfinite(proposal.prediction.sigma_depth_m)) {
    return Fail(
        "none of {} ways to capture measures {:g} % of the visible surface: more light, a larger "
        "budget, a longer max_exposure_s = {:g}, or a lower covered_ratio",
        proposal.num_compared, 100.0 * config.covered_ratio, config.max_exposure_s);
  }
  proposal.num_frames = NumFrames(proposal.settings);
  proposal.seconds = Seconds(proposal.settings, scene.frame_overhead_s);
  proposal.notes = Notes(scene, proposal, config);
  return proposal;
}

}  // namespace fringe_fusion
