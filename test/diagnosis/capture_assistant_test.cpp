#include "fringe_fusion/diagnosis/capture_assistant.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "bench/capture_scenes.hpp"
#include "test/support/draws.hpp"

namespace fringe_fusion {
namespace {

using bench::CaptureBench;
using bench::CaptureCase;

constexpr double kUnitQuantile90 = 1.6448536;  // of |normal|

CaptureAssistantConfig BenchConfig() {
  CaptureAssistantConfig config;
  config.min_exposure_s = 0.0025;
  config.max_exposure_s = 0.08;
  config.max_samples = 120;  // enough, and quick
  return config;
}

CaptureBench BenchOf(const std::string& name) {
  for (const CaptureCase& scene : bench::CaptureCases()) {
    if (scene.name == name) return MakeCaptureBench(scene);
  }
  throw std::runtime_error("no such scene: " + name);
}

ImageStack TestExposures(CaptureBench& bench) {
  return bench::CaptureSequence(bench.cell, TestPattern(bench.calibration), 0.01);
}

CaptureScene Measure(CaptureBench& bench) {
  auto scene =
      MeasureCaptureScene(TestExposures(bench), bench.calibration, PhaseConfig{}, BenchConfig());
  if (!scene) throw std::runtime_error(scene.error().message);
  return std::move(*scene);
}

double Sigma(CaptureBench& bench, const CaptureSettings& settings) {
  return MeasureSigma(bench, settings, BenchConfig().covered_ratio, kUnitQuantile90);
}

TEST(CaptureScene, IsMeasuredAsSimulated) {
  CaptureBench bench = BenchOf("blurred ball bar, 20 frames");
  const CaptureScene scene = Measure(bench);
  EXPECT_TRUE(scene.measured_noise);
  EXPECT_TRUE(scene.measured_fringes);
  EXPECT_NEAR(scene.read_noise_dn, bench.scene.config.read_noise_dn, 0.1);
  EXPECT_NEAR(scene.gain_dn, bench.scene.config.gain_dn, 0.006);
  EXPECT_NEAR(scene.mean_ratio, 0.5, 0.01);
  EXPECT_NEAR(scene.fringe_ratio, 0.5, 0.01);
  // Projector, half a pixel of bilinear light, and the camera's own blur on the surface.
  EXPECT_NEAR(scene.blur_px[0], 2.6, 0.15);
  EXPECT_NEAR(scene.response.gamma, 1.0, 0.02);
  EXPECT_EQ(scene.size_px[0], bench.calibration.projector.width);
  EXPECT_GT(scene.num_visible, 1500);
  // Depth from the shift along u: z^2 / (f b) metres per pixel.
  const CameraModel& projector = bench.calibration.projector;
  const double baseline_m = bench.calibration.T_projector_camera.translation().norm();
  EXPECT_NEAR(scene.pixels[scene.pixels.size() / 2].px_per_m.x(),
              projector.fx * baseline_m / (0.5 * 0.5),
              0.2 * projector.fx * baseline_m / (0.5 * 0.5));
}

TEST(CaptureScene, AssumesWhatWhiteAndBlackDoNotTell) {
  CaptureBench bench = BenchOf("freeform, 26 frames");
  ImageStack test = TestExposures(bench);
  ImageStack light = test;
  light.sequence.frames.clear();
  light.frames.clear();
  for (std::size_t i = 0; i < test.frames.size(); ++i) {
    const PatternKind kind = test.sequence.frames[i].kind;
    if (kind != PatternKind::kWhite && kind != PatternKind::kBlack) continue;
    light.sequence.frames.push_back(test.sequence.frames[i]);
    light.frames.push_back(test.frames[i]);
  }
  CaptureAssistantConfig config = BenchConfig();
  config.blur_px = 0.8;
  PhaseConfig phase;
  phase.read_noise_dn = 1.25;
  const auto scene = MeasureCaptureScene(light, bench.calibration, phase, config);
  ASSERT_TRUE(scene) << scene.error().message;
  EXPECT_FALSE(scene->measured_fringes);
  EXPECT_EQ(scene->blur_px[1], 0.8);
  EXPECT_EQ(scene->read_noise_dn, scene->measured_noise ? scene->read_noise_dn : 1.25);
  const auto proposal = ProposeCapture(*scene, phase, config, {26, 0.0});
  ASSERT_TRUE(proposal) << proposal.error().message;
  EXPECT_TRUE(std::any_of(proposal->notes.begin(), proposal->notes.end(), [](const auto& note) {
    return note.find("blur of 0.8 px is assumed") != std::string::npos;
  }));
}

TEST(CapturePrediction, AgreesWithMeasuredErrors) {
  CaptureBench bench = BenchOf("ambient light, 16 frames");
  const CaptureScene scene = Measure(bench);
  const CaptureSettings many[] = {{{0.02}, {1, 6, 24}, 4, true, false},
                                  {{0.02}, {18, 22, 23}, 5, true, false},
                                  {{0.005, 0.02}, {1, 5, 20}, 3, true, false}};
  for (const CaptureSettings& settings : many) {
    const auto predicted = PredictCapture(scene, settings, bench.phase, BenchConfig());
    ASSERT_TRUE(predicted) << predicted.error().message;
    const double measured_m = Sigma(bench, settings);
    EXPECT_NEAR(predicted->sigma_depth_m / measured_m, 1.0, 0.12)
        << fmt::format("{}", fmt::join(settings.fringes, ","));
  }
  // Two frequencies this far apart leave the order in doubt, and the prediction knows.
  const CaptureSettings doubtful{{0.02}, {1, 24}, 4, true, false};
  const auto predicted = PredictCapture(scene, doubtful, bench.phase, BenchConfig());
  ASSERT_TRUE(predicted) << predicted.error().message;
  EXPECT_GT(predicted->doubtful_ratio, 0.7);
  EXPECT_TRUE(std::isinf(predicted->sigma_depth_m));
}

TEST(CaptureProposal, ComesNearTheBestOfAnExhaustiveSearch) {
  CaptureBench bench = BenchOf("noisy sphere, 11 frames");
  const auto proposal =
      ProposeCapture(Measure(bench), PhaseConfig{}, BenchConfig(), bench.scene.budget);
  ASSERT_TRUE(proposal) << proposal.error().message;
  EXPECT_LE(proposal->num_frames, 11);
  const double own_m = Sigma(bench, proposal->settings);
  double best_m = std::numeric_limits<double>::infinity();
  for (const double exposure_s : {0.01, 0.014, 0.02, 0.028, 0.04}) {
    for (const double finest : test_support::Cases({18.0, 8.0, 12.0, 26.0, 36.0})) {
      const double root = std::round(std::sqrt(finest));
      best_m = std::min(best_m, Sigma(bench, {{exposure_s}, {1, root, finest}, 3, true, false}));
      best_m = std::min(best_m, Sigma(bench, {{exposure_s}, {1, finest}, 4, true, false}));
      best_m = std::min(
          best_m,
          Sigma(bench, {{exposure_s}, {finest - root, finest - 1, finest}, 3, true, false}));
    }
  }
  EXPECT_LE(own_m, 1.10 * best_m);
}

TEST(CaptureProposal, KeepsToTheBudgetAndToTheProjectorsFrames) {
  CaptureBench bench = BenchOf("freeform, 26 frames");
  const CaptureScene scene = Measure(bench);
  CaptureAssistantConfig config = BenchConfig();
  config.exposure_step_s = 1.0 / 60.0;
  config.both_axes = true;
  const auto proposal = ProposeCapture(scene, PhaseConfig{}, config, {0, 2.0});
  ASSERT_TRUE(proposal) << proposal.error().message;
  EXPECT_LE(proposal->seconds, 2.0);
  EXPECT_TRUE(proposal->settings.axis_u && proposal->settings.axis_v);
  for (const double exposure_s : proposal->settings.exposures_s) {
    EXPECT_NEAR(std::remainder(exposure_s, 1.0 / 60.0), 0.0, 1e-9);
  }
  const auto frames = ProposeCapture(scene, PhaseConfig{}, BenchConfig(), {17, 0.0});
  ASSERT_TRUE(frames) << frames.error().message;
  EXPECT_LE(frames->num_frames, 17);
  EXPECT_EQ(frames->num_frames, NumFrames(frames->settings));
  const auto sequence =
      MakeSequence(ToPatternConfig(frames->settings), scene.size_px[0], scene.size_px[1]);
  ASSERT_TRUE(sequence) << sequence.error().message;
  EXPECT_EQ(static_cast<int>(sequence->frames.size()), frames->num_frames);
}

TEST(CaptureProposal, AdvisesToCorrectTheResponse) {
  CaptureCase scene = bench::MakeCaptureCase("gamma", 0, {17, 0.0}, 9100);
  CaptureBench bench = MakeCaptureBench(scene);
  CaptureScene measured = Measure(bench);
  measured.response = PowerResponse(2.2);
  const auto proposal = ProposeCapture(measured, PhaseConfig{}, BenchConfig(), {8, 0.0});
  ASSERT_TRUE(proposal) << proposal.error().message;
  EXPECT_TRUE(std::any_of(proposal->notes.begin(), proposal->notes.end(), [](const auto& note) {
    return note.find("gamma 2.20 leaves a ripple of") != std::string::npos;
  }));
}

TEST(CaptureAssistant, RefusesWhatItCannotUse) {
  CaptureBench bench = BenchOf("freeform, 26 frames");
  const ImageStack test = TestExposures(bench);
  const auto refusal = [&](const ImageStack& stack) {
    const auto scene =
        MeasureCaptureScene(stack, bench.calibration, PhaseConfig{}, CaptureAssistantConfig{});
    return scene ? std::string("accepted") : scene.error().message;
  };
  ImageStack no_time = test;
  no_time.frames[3].exposure_s = 0.0;
  EXPECT_EQ(refusal(no_time), "test exposures: frame 3 does not state its exposure time");
  ImageStack two_gains = test;
  two_gains.frames[5].gain = 2.0;
  EXPECT_NE(refusal(two_gains).find("frame 5 was taken at gain 2"), std::string::npos);
  ImageStack dark = test;
  for (CapturedFrame& frame : dark.frames) {
    auto& pixels = std::get<Image<std::uint8_t>>(frame.pixels);
    std::fill(pixels.begin(), pixels.end(), std::uint8_t{7});
  }
  EXPECT_NE(refusal(dark).find("no pixel sees the projector"), std::string::npos);
  ImageStack no_white = test;
  for (Pattern& pattern : no_white.sequence.frames) {
    if (pattern.kind == PatternKind::kWhite) pattern.kind = PatternKind::kBlack;
  }
  EXPECT_NE(refusal(no_white).find("no exposure has both a white and a black"), std::string::npos);
  CellCalibration other = bench.calibration;
  other.camera.width += 2;
  EXPECT_FALSE(MeasureCaptureScene(test, other, PhaseConfig{}, CaptureAssistantConfig{}));

  const CaptureScene scene = Measure(bench);
  const auto budget = [&](int frames, double seconds) {
    const auto proposal =
        ProposeCapture(scene, PhaseConfig{}, CaptureAssistantConfig{}, {frames, seconds});
    return proposal ? std::string("accepted") : proposal.error().message;
  };
  EXPECT_NE(budget(0, 0.0).find("exactly one must be positive"), std::string::npos);
  EXPECT_NE(budget(20, 1.0).find("exactly one must be positive"), std::string::npos);
  EXPECT_NE(budget(0, std::nan("")).find("exactly one must be positive"), std::string::npos);
  EXPECT_NE(budget(7, 0.0).find("capture budget of 7 frames: no code fits"), std::string::npos);
  EXPECT_FALSE(ProposeCapture({}, PhaseConfig{}, CaptureAssistantConfig{}, {20, 0.0}));
  EXPECT_FALSE(PredictCapture(scene, {{0.01}, {8}, 4, true, false}, PhaseConfig{}, {}));
  EXPECT_FALSE(PredictCapture(scene, {{0.01}, {1, 8}, 2, true, false}, PhaseConfig{}, {}));
  EXPECT_FALSE(PredictCapture(scene, {{}, {1, 8}, 4, true, false}, PhaseConfig{}, {}));
}

}  // namespace
}  // namespace fringe_fusion
