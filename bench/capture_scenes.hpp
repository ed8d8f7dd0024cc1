#pragma once

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis_scenes.hpp"
#include "fringe_fusion/diagnosis/capture_assistant.hpp"
#include "fringe_fusion/triangulation/range_image.hpp"
#include "test/sim/scenes.hpp"

// Scenes on which the capture assistant is held against an exhaustive search, and the figure that
// both are judged by: the measured depth sigma.
namespace fringe_fusion::bench {

/// One scene with what its capture may cost.
struct CaptureCase {
  std::string name;
  sim::SimConfig config;
  int object = 0;  ///< kind of MakeDiagnosisObject
  CaptureBudget budget;
};

inline CaptureCase MakeCaptureCase(const std::string& name, int object, const CaptureBudget& budget,
                                   int seed) {
  CaptureCase scene;
  scene.name = name;
  scene.object = object;
  scene.budget = budget;
  scene.config.seed = seed;
  scene.config.projector_black_ratio = 0.004;
  scene.config.projector_blur_px = 0.6;
  scene.config.ambient_ratio = 0.05;
  scene.config.camera_blur_px = 0.4;
  scene.config.gain_dn = 0.05;
  scene.config.read_noise_dn = 1.0;
  scene.config.frame_period_s = 0.001;  // the exposure sets the pace
  return scene;
}

/// Several objects, albedos, noises, blurs and budgets. Fixed before the assistant was tuned.
inline std::vector<CaptureCase> CaptureCases() {
  std::vector<CaptureCase> cases;
  cases.push_back(MakeCaptureCase("freeform, 26 frames", 0, {26, 0.0}, 9001));
  cases.push_back(MakeCaptureCase("dark freeform, 26 frames", 0, {26, 0.0}, 9002));
  cases.back().config.albedo = 0.08;
  cases.push_back(MakeCaptureCase("checkered steps, 40 frames", 1, {40, 0.0}, 9003));
  cases.back().config.texture_contrast = 0.9;
  cases.back().config.albedo = 0.9;
  cases.push_back(MakeCaptureCase("noisy sphere, 11 frames", 2, {11, 0.0}, 9004));
  cases.back().config.gain_dn = 0.2;
  cases.back().config.read_noise_dn = 4.0;
  cases.push_back(MakeCaptureCase("blurred ball bar, 20 frames", 3, {20, 0.0}, 9005));
  cases.back().config.projector_blur_px = 2.5;
  cases.push_back(MakeCaptureCase("corner, 12 bit, 0.6 s", 4, {0, 0.6}, 9006));
  cases.back().config.bit_depth = 12;
  cases.back().config.gain_dn = 0.8;
  cases.back().config.read_noise_dn = 10.0;
  cases.push_back(MakeCaptureCase("ambient light, 16 frames", 0, {16, 0.0}, 9007));
  cases.back().config.ambient_ratio = 0.8;
  cases.push_back(MakeCaptureCase("checkered freeform, 1.5 s", 0, {0, 1.5}, 9008));
  cases.back().config.texture_contrast = 0.8;
  cases.back().config.gain_dn = 0.1;
  return cases;
}

/// A scene set up, with the surface that counts.
struct CaptureBench {
  CaptureCase scene;
  CellCalibration calibration;
  sim::SimCell cell;
  Image<float> range_m;  ///< NaN: not visible, or within 2 pixels of an edge of what is
  PhaseConfig phase;     ///< the decoder knows the true noise
};

/// Pixels whose fringes the longest exposure lifts to twice the least modulation: what the
/// assistant calls visible.
inline Image<std::uint8_t> ReachableLight(sim::SimCell& cell, double longest_s) {
  const sim::SimConfig& config = cell.config();
  constexpr double kLeastSigma = 10.0;
  constexpr double kExposure = 0.01;
  const auto shoot = [&](std::uint8_t value) {
    auto frame = cell.Expose(sim::Flat(cell.calibration(), value), kExposure, 9000 + value);
    if (!frame) throw std::runtime_error(frame.error().message);
    return std::move(frame->pixels);
  };
  const FramePixels black = shoot(0);
  const FramePixels white = shoot(255);
  const CameraModel& camera = cell.calibration().camera;
  Image<std::uint8_t> reachable(camera.width, camera.height);
  for (std::size_t i = 0; i < reachable.size(); ++i) {
    const auto value = [i](const FramePixels& frame) {
      return std::visit([i](const auto& pixels) { return static_cast<double>(pixels[i]); }, frame);
    };
    const double scale = longest_s / kExposure;
    const double sigma = std::sqrt(config.read_noise_dn * config.read_noise_dn +
                                   config.gain_dn * scale * value(white));
    reachable[i] = 0.5 * scale * (value(white) - value(black)) > kLeastSigma * sigma ? 1 : 0;
  }
  return reachable;
}

/// Range of the visible surface, a margin of 2 pixels at depth steps and shadows taken off.
inline Image<float> VisibleRange(const sim::ViewTruth& truth,
                                 const Image<std::uint8_t>& reachable) {
  constexpr int kMargin = 2;
  constexpr float kJump = 0.03F;  // of the range
  const int width = truth.lit.width();
  const int height = truth.lit.height();
  Image<float> range(width, height, std::numeric_limits<float>::quiet_NaN());
  for (int y = kMargin; y < height - kMargin; ++y) {
    for (int x = kMargin; x < width - kMargin; ++x) {
      const float own = truth.points(x, y).norm();
      bool smooth = reachable(x, y) != 0;
      for (int j = -kMargin; j <= kMargin && smooth; ++j) {
        for (int i = -kMargin; i <= kMargin && smooth; ++i) {
          smooth = truth.lit(x + i, y + j) != 0 &&
                   std::abs(truth.points(x + i, y + j).norm() - own) < kJump * own;
        }
      }
      if (smooth) range(x, y) = own;
    }
  }
  return range;
}

inline CaptureBench MakeCaptureBench(const CaptureCase& scene) {
  Draw draw(scene.config.seed);
  const CellCalibration calibration = sim::SmallScanner(4);
  const Mesh object = MakeDiagnosisObject(scene.object, draw);
  const bool corner = scene.object == 4;
  auto cell = sim::SimCell::Create(scene.config, calibration, object,
                                   corner ? Mesh{} : sim::MakePlate(0.07, 0.005));
  if (!cell) throw std::runtime_error(cell.error().message);
  const Transform T =
      sim::TurntablePose(draw.Pick(360), 360, 0.5, corner ? 70.0 : 35.0, {0.0, 0.0, 0.03});
  if (const Status status = cell->MoveTo(T, 0); !status) {
    throw std::runtime_error(status.error().message);
  }
  PhaseConfig phase;
  phase.read_noise_dn = scene.config.read_noise_dn;
  phase.gain_dn = scene.config.gain_dn;
  constexpr double kLongest = 0.08;
  Image<float> range = VisibleRange(cell->Truth(), ReachableLight(*cell, kLongest));
  return {scene, calibration, std::move(*cell), std::move(range), phase};
}

inline ImageStack CaptureSequence(sim::SimCell& cell, const PatternConfig& pattern,
                                  double exposure_s) {
  const CameraModel& projector = cell.calibration().projector;
  const auto sequence = MakeSequence(pattern, projector.width, projector.height);
  if (!sequence) throw std::runtime_error(sequence.error().message);
  auto stack = sim::CaptureStack(cell, *sequence, cell.config().projector_gamma, exposure_s, 0);
  if (!stack) throw std::runtime_error(stack.error().message);
  return std::move(*stack);
}

/// The figure that CapturePrediction::sigma_depth_m predicts, measured against the truth: the
/// quantile of |range error| over the visible surface, lost pixels counting as infinite, over that
/// of a unit normal variable [m].
inline double MeasureSigma(CaptureBench& bench, const CaptureSettings& settings,
                           double covered_ratio, double unit_quantile) {
  const ImageStack stack =
      CaptureSequence(bench.cell, ToPatternConfig(settings), settings.exposures_s.front());
  const auto phase = DecodePhase(stack, bench.phase);
  if (!phase) throw std::runtime_error(phase.error().message);
  TriangulationConfig triangulation;
  triangulation.min_component_px = 0;
  const auto made = Triangulate(*phase, bench.calibration, triangulation);
  if (!made) throw std::runtime_error(made.error().message);
  std::vector<float> errors;
  for (std::size_t i = 0; i < bench.range_m.size(); ++i) {
    if (!std::isfinite(bench.range_m[i])) continue;
    const Eigen::Vector3f& point = made->range.points[i];
    errors.push_back(point.allFinite() ? std::abs(point.norm() - bench.range_m[i])
                                       : std::numeric_limits<float>::infinity());
  }
  const auto place = errors.begin() + static_cast<std::ptrdiff_t>(
                                          covered_ratio * static_cast<double>(errors.size()));
  std::nth_element(errors.begin(), place, errors.end());
  return static_cast<double>(*place) / unit_quantile;
}

}  // namespace fringe_fusion::bench
