// Holds the capture assistant against an exhaustive search with the measured depth sigma.
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

#include "capture_scenes.hpp"

namespace fringe_fusion::bench {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kUnitQuantile90 = 1.6448536;  // of |normal|
constexpr double kLargestRatio = 1.10;

std::string Describe(const CaptureSettings& settings) {
  return fmt::format("{:.4g} s, {} x {} steps, {}", fmt::join(settings.exposures_s, "+"),
                     fmt::join(settings.fringes, ","), settings.steps, NumFrames(settings));
}

/// Codes of the exhaustive search, written down without looking at what the assistant tries.
std::vector<std::vector<double>> GridCodes() {
  std::vector<std::vector<double>> codes;
  for (const double f : {12.0, 18.0, 26.0, 36.0}) {
    const double root = std::round(std::sqrt(f));
    codes.push_back({1.0, f});
    codes.push_back({f - 1.0, f});
    codes.push_back({1.0, root, f});
    codes.push_back({1.0, std::round(std::pow(f, 0.75)), f});
    codes.push_back({f - root, f - 1.0, f});
    codes.push_back({f - root - 1.0, f - root, f});
    codes.push_back({1.0, std::round(std::cbrt(f)), std::round(std::cbrt(f * f)), f});
  }
  return codes;
}

std::vector<std::vector<double>> GridExposures() {
  std::vector<std::vector<double>> sets;
  for (const double t : {0.005, 0.01, 0.02, 0.04, 0.08}) {
    sets.push_back({t});
    if (t < 0.03) sets.push_back({t, 4.0 * t});
  }
  return sets;
}

/// As many steps as the budget has; 0: fewer than three.
int StepsFor(const CaptureSettings& settings, const CaptureBudget& budget) {
  double each = budget.frames / static_cast<double>(settings.exposures_s.size());
  if (budget.frames == 0) {
    double seconds = 0.0;
    for (const double t : settings.exposures_s) seconds += t;
    each = budget.seconds / seconds;
  }
  const auto steps =
      static_cast<int>((each - 2.0) / static_cast<double>(settings.fringes.size()) + 1e-9);
  return steps < 3 ? 0 : std::min(steps, 64);
}

struct Best {
  CaptureSettings settings;
  double sigma_m = kInfinity;
  int num_tried = 0;
};

void Try(CaptureBench& bench, const CaptureSettings& settings, double covered, Best& best) {
  const CameraModel& projector = bench.calibration.projector;
  if (!MakeSequence(ToPatternConfig(settings), projector.width, projector.height)) return;
  ++best.num_tried;
  const double sigma_m = MeasureSigma(bench, settings, covered, kUnitQuantile90);
  if (!(sigma_m < best.sigma_m)) return;
  best.sigma_m = sigma_m;
  best.settings = settings;
}

Best SearchGrid(CaptureBench& bench, const CaptureAssistantConfig& config) {
  const double covered = config.covered_ratio;
  Best best;
  CaptureSettings settings;
  for (const auto& exposures : GridExposures()) {
    settings.exposures_s = exposures;
    for (const auto& fringes : GridCodes()) {
      settings.fringes = fringes;
      settings.steps = StepsFor(settings, bench.scene.budget);
      if (settings.steps >= 3) Try(bench, settings, covered, best);
    }
  }
  // Exposures between those of the grid, for the best code, within the limits of both.
  const auto is_allowed = [&](double t) {
    return t >= config.min_exposure_s && t <= config.max_exposure_s;
  };
  const CaptureSettings coarse = best.settings;
  for (const double ratio : {0.5, 0.6, 0.7, 0.8, 0.9, 1.1, 1.2, 1.3, 1.45, 1.6, 1.8, 2.0}) {
    for (std::size_t e = 0; e < coarse.exposures_s.size(); ++e) {
      settings = coarse;
      settings.exposures_s[e] *= ratio;
      if (!is_allowed(settings.exposures_s[e])) continue;
      std::sort(settings.exposures_s.begin(), settings.exposures_s.end());
      settings.steps = StepsFor(settings, bench.scene.budget);
      if (settings.steps >= 3) Try(bench, settings, covered, best);
    }
  }
  return best;
}

/// @return measured sigma of the proposal over that of the best of the grid.
double Compare(const CaptureCase& scene) {
  CaptureBench bench = MakeCaptureBench(scene);
  CaptureAssistantConfig config;
  config.max_exposure_s = 0.08;
  config.min_exposure_s = 0.0025;
  config.frame_overhead_s = 1e-9;  // the grid counts exposures alone
  const ImageStack test = CaptureSequence(bench.cell, TestPattern(bench.calibration), 0.01);
  const auto measured = MeasureCaptureScene(test, bench.calibration, PhaseConfig{}, config);
  if (!measured) throw std::runtime_error(measured.error().message);
  const auto proposal = ProposeCapture(*measured, PhaseConfig{}, config, scene.budget);
  if (!proposal) throw std::runtime_error(proposal.error().message);
  const double covered = config.covered_ratio;
  const double own_m = MeasureSigma(bench, proposal->settings, covered, kUnitQuantile90);
  fmt::print("{}: blur {:.2f} px, read {:.2f}, gain {:.3f}\n", scene.name, measured->blur_px[0],
             measured->read_noise_dn, measured->gain_dn);
  fmt::print("  proposed  {:50} predicted {:6.2f} um, measured {:6.2f} um ({} compared)\n",
             Describe(proposal->settings), proposal->prediction.sigma_depth_m * 1e6, own_m * 1e6,
             proposal->num_compared);
  std::fflush(stdout);
  const Best best = SearchGrid(bench, config);
  const auto predicted = PredictCapture(*measured, best.settings, PhaseConfig{}, config);
  const double ratio = own_m / best.sigma_m;
  fmt::print("  best grid {:50} predicted {:6.2f} um, measured {:6.2f} um ({} measured)\n",
             Describe(best.settings), predicted ? predicted->sigma_depth_m * 1e6 : 0.0,
             best.sigma_m * 1e6, best.num_tried);
  for (const std::string& note : proposal->notes) fmt::print("  note: {}\n", note);
  fmt::print("  ratio {:.3f}\n", ratio);
  std::fflush(stdout);
  return ratio;
}

int Run(int argc, char** argv) {
  const std::vector<CaptureCase> cases = CaptureCases();
  double worst = 0.0;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    if (argc > 1 && std::atoi(argv[1]) != static_cast<int>(i)) continue;
    worst = std::max(worst, Compare(cases[i]));
  }
  fmt::print("worst ratio {:.3f}, limit {:.2f}\n", worst, kLargestRatio);
  return worst <= kLargestRatio ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace
}  // namespace fringe_fusion::bench

int main(int argc, char** argv) { return fringe_fusion::bench::Run(argc, argv); }
