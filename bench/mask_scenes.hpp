#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "fringe_fusion/sim/gauges.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"

// Scenes and seeds on which the masks and the stated sigma of the decoder are judged. They were
// fixed before any limit was chosen; limits are chosen on TuningSeed alone.
namespace fringe_fusion::bench {

constexpr int kNumTuningScenes = 18;
constexpr int kNumEvaluationScenes = 42;
constexpr int TuningSeed(int scene) { return 300007 + 29 * scene; }
constexpr int EvaluationSeed(int scene) { return 900001 + 41 * scene; }

/// The codes take turns: scene i of either set uses code i % kNumMaskCodes.
constexpr int kNumMaskCodes = 6;
constexpr std::array<const char*, kNumMaskCodes> kMaskCodeNames{
    "1,8,64 N=4", "1,6,36 N=5", "1,5,25 N=3", "Gray + 64 N=4", "59,63,64 N=4", "1,8,64 N=4 HDR"};

struct MaskScene {
  sim::SimConfig config;
  PatternConfig pattern;
  Mesh object;
  Mesh background;
  Transform T_object_camera = Transform::Identity();
  int code = 0;
};

/// Uniform numbers that are the same with every standard library.
class MaskDraw {
 public:
  explicit MaskDraw(int seed) : engine_(static_cast<unsigned>(seed)) { engine_.discard(16); }
  double operator()(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_()) + 0.5) / 4294967296.0;
  }
  int Pick(int count) { return static_cast<int>((*this)(0.0, count)); }

 private:
  std::mt19937 engine_;
};

inline PatternConfig MaskPattern(int code) {
  constexpr std::array<const char*, kNumMaskCodes> kFringes{"1,8,64", "1,6,36",   "1,5,25",
                                                            "64",     "59,63,64", "1,8,64"};
  constexpr std::array<int, kNumMaskCodes> kSteps{4, 5, 3, 4, 4, 4};
  PatternConfig pattern;
  pattern.fringes = kFringes[static_cast<std::size_t>(code)];
  pattern.steps = kSteps[static_cast<std::size_t>(code)];
  pattern.gray = code == 3;
  pattern.gray_half_period = code == 3;
  if (code == 5) pattern.exposures = "0.3,1,3";
  return pattern;
}

/// Depth edges of all heights (steps down to a tenth of a millimetre), curved rims, thin ribs.
inline Mesh MaskObject(int kind, MaskDraw& draw) {
  switch (kind) {
    case 0:
      return sim::MakeFreeform(2e-3);
    case 1:
      return sim::MakeStepBlock(2 + draw.Pick(5), draw(1e-4, 3e-3), draw(0.008, 0.018), 0.07);
    case 2:
      return sim::MakeStepBlock(2 + draw.Pick(4), draw(0.004, 0.012), draw(0.012, 0.018), 0.07);
    case 3:
      return sim::MakeSphere({0.0, 0.0, 0.035}, draw(0.025, 0.035), 5);
    default:
      return sim::MakeBallBar(draw(0.05, 0.08), 0.016);
  }
}

inline void DrawMaskDevices(MaskDraw& draw, sim::SimConfig& config) {
  config.projector_black_ratio = draw(0.001, 0.01);
  config.projector_blur_px = draw(0.4, 1.0);
  config.projector_focus_m = draw(0.47, 0.53);
  config.projector_defocus_px_m = draw(0.0, 4.0);
  config.albedo = draw(0.3, 0.9);
  config.texture_contrast = draw.Pick(2) == 0 ? draw(0.1, 0.6) : 0.0;
  config.texture_period_m = draw(0.01, 0.03);
  config.specular_ratio = draw.Pick(2) == 0 ? draw(0.1, 0.6) : 0.0;
  config.specular_exponent = draw(20.0, 80.0);
  config.ambient_ratio = draw(0.01, 0.15);
  config.camera_blur_px = draw(0.2, 0.6);
  config.bit_depth = draw.Pick(3) == 0 ? 12 : 8;
  const double scale = config.bit_depth == 12 ? 16.0 : 1.0;
  config.gain_dn = scale * draw(0.02, 0.08);
  config.read_noise_dn = scale * draw(0.5, 1.5);
  config.white_level_ratio = draw(0.5, 1.0);
}

/// The default scanner before an object on a plate, or before the object alone.
inline MaskScene MakeMaskScene(int seed, int code) {
  MaskDraw draw(seed);
  MaskScene scene;
  scene.code = code;
  scene.config.seed = seed;
  DrawMaskDevices(draw, scene.config);
  scene.pattern = MaskPattern(code);
  scene.object = MaskObject(draw.Pick(5), draw);
  if (draw.Pick(3) != 0) scene.background = sim::MakePlate(0.07, 0.005);
  const double elevation_deg = draw(20.0, 60.0);
  scene.T_object_camera =
      sim::TurntablePose(draw.Pick(360), 360, draw(0.46, 0.54), elevation_deg, {0.0, 0.0, 0.03});
  return scene;
}

inline sim::SimCell MakeMaskCell(const MaskScene& scene, const sim::SimConfig& config) {
  Result<sim::SimCell> cell =
      sim::SimCell::Create(config, sim::DefaultCalibration(), scene.object, scene.background);
  if (!cell) throw std::runtime_error(cell.error().message);
  if (const Status status = cell->MoveTo(scene.T_object_camera, 0); !status) {
    throw std::runtime_error(status.error().message);
  }
  return std::move(*cell);
}

/// All frames of the scene with its noise.
inline ImageStack CaptureMaskScene(sim::SimCell& cell, const MaskScene& scene) {
  const CameraModel& projector = cell.calibration().projector;
  const PatternSequence sequence =
      MakeSequence(scene.pattern, projector.width, projector.height).value();
  Result<ImageStack> stack =
      CaptureStack(cell, sequence, 1.0, scene.config.exposure_reference_s, 0);
  if (!stack) throw std::runtime_error(stack.error().message);
  return std::move(*stack);
}

/// White and black pictures without noise at the exposure of the scan, at 12 bit [DN of the scan].
struct CleanLight {
  Image<float> white;
  Image<float> black;
};

inline CleanLight CaptureCleanLight(const MaskScene& scene) {
  sim::SimConfig config = scene.config;
  config.gain_dn = 0.0;
  config.read_noise_dn = 0.0;
  config.bit_depth = 12;
  // Half the exposure: what saturates in the scan must show by how much.
  constexpr double kShare = 0.5;
  const double scale = ((1 << scene.config.bit_depth) - 1) / 4095.0 / kShare;
  sim::SimCell cell = MakeMaskCell(scene, config);
  const CameraModel& projector = cell.calibration().projector;
  const auto shoot = [&](std::uint8_t value) {
    const Image<std::uint8_t> picture(projector.width, projector.height, value);
    Result<CapturedFrame> frame = cell.Expose(picture, kShare * config.exposure_reference_s, 0);
    if (!frame) throw std::runtime_error(frame.error().message);
    const auto& words = std::get<Image<std::uint16_t>>(frame->pixels);
    Image<float> dn(words.width(), words.height());
    for (std::size_t i = 0; i < dn.size(); ++i) {
      dn[i] = static_cast<float>(scale * static_cast<double>(words[i]));
    }
    return dn;
  };
  return {shoot(255), shoot(0)};
}

/// A pixel is truly good when
/// - it and its eight neighbours show lit points that the projector covers, on one surface: no
///   neighbour lies off the centre's tangent plane, or the centre off the neighbour's, by more than
///   20 degrees. Borders of paint do not make it bad;
/// - white light stays 4 sigma of noise below saturation (the shortest exposure decides);
/// - the modulation of a coarse fringe is at least ten times the noise, at the longest exposure
///   that does not saturate;
/// - at that modulation the code mistakes its fringe order with a probability below 1e-4;
/// - it lies at least 3 px inside the projector's picture.
class GoodPixels {
 public:
  GoodPixels(const MaskScene& scene, const sim::ViewTruth& truth, const CleanLight& light)
      : scene_(scene),
        truth_(truth),
        light_(light),
        projector_(sim::DefaultCalibration().projector),
        order_distance_(OrderDistance(scene.pattern)) {}

  [[nodiscard]] bool IsGood(int x, int y) const {
    return OnOneSurface(x, y) && IsBrightEnough(x, y) && IsInside(x, y);
  }

  /// The light changes by more than a twentieth within two pixels: paint, or a highlight.
  [[nodiscard]] bool HasTextureNear(int x, int y) const {
    const float here = light_.white(x, y);
    for (int j = y - 2; j <= y + 2; ++j) {
      for (int i = x - 2; i <= x + 2; ++i) {
        if (!light_.white.Contains(i, j)) continue;
        if (!(std::abs(light_.white(i, j) - here) <= 0.05F * here)) return true;
      }
    }
    return false;
  }

 private:
  [[nodiscard]] bool OnOneSurface(int x, int y) const {
    if (truth_.lit(x, y) == 0) return false;
    constexpr float kSine = 0.342F;
    for (int j = y - 1; j <= y + 1; ++j) {
      for (int i = x - 1; i <= x + 1; ++i) {
        if (!truth_.lit.Contains(i, j) || truth_.lit(i, j) == 0) return false;
        const Eigen::Vector3f apart = truth_.points(i, j) - truth_.points(x, y);
        const float limit = kSine * apart.norm();
        if (std::abs(truth_.normals(x, y).dot(apart)) > limit) return false;
        if (std::abs(truth_.normals(i, j).dot(apart)) > limit) return false;
      }
    }
    return true;
  }

  [[nodiscard]] bool IsBrightEnough(int x, int y) const {
    const bool hdr = scene_.code == 5;
    const double limit = 0.98 * ((1 << scene_.config.bit_depth) - 1);
    for (const double exposure :
         hdr ? std::array<double, 3>{3.0, 1.0, 0.3} : std::array<double, 3>{1.0, 1.0, 1.0}) {
      const double white = exposure * static_cast<double>(light_.white(x, y));
      const double black = exposure * static_cast<double>(light_.black(x, y));
      if (white + 4.0 * Noise(white) >= limit) continue;
      const double ratio = Noise(0.5 * (white + black)) / (0.5 * (white - black));
      return ratio <= 0.1 && HasOrder(ratio);
    }
    return false;
  }

  [[nodiscard]] double Noise(double grey) const {
    const double read = scene_.config.read_noise_dn;
    return std::sqrt(read * read + scene_.config.gain_dn * grey + 1.0 / 12.0);
  }

  // Science section 2.3: half the distance to the nearest other order in sigma of a phase.
  [[nodiscard]] bool HasOrder(double noise_ratio) const {
    const double sigma_cycles =
        std::sqrt(2.0 / scene_.pattern.steps) * noise_ratio / (2.0 * 3.14159265358979323846);
    return std::erfc(order_distance_ / (2.0 * std::sqrt(2.0) * sigma_cycles)) <= 1e-4;
  }

  // Least distance [cycles] of the phases of two places that differ by half a fine fringe or more.
  // A Gray code tells the orders by its bits.
  [[nodiscard]] static double OrderDistance(const PatternConfig& pattern) {
    if (pattern.gray) return 1.0;
    std::vector<double> fringes;
    std::stringstream list(pattern.fringes);
    for (std::string item; std::getline(list, item, ',');) fringes.push_back(std::stod(item));
    constexpr int kSteps = 20000;
    double least = 1.0;
    for (int i = 0; i < kSteps; ++i) {
      const double place = static_cast<double>(i) / kSteps;
      if (place < 0.5 / fringes.back() || place > 1.0 - 0.5 / fringes.back()) continue;
      double squares = 0.0;
      for (const double f : fringes) squares += std::pow(std::remainder(f * place, 1.0), 2);
      least = std::min(least, std::sqrt(squares));
    }
    return least;
  }

  [[nodiscard]] bool IsInside(int x, int y) const {
    constexpr float kMargin = 3.0F;
    return truth_.u(x, y) >= kMargin && truth_.v(x, y) >= kMargin &&
           truth_.u(x, y) <= static_cast<float>(projector_.width) - 1.0F - kMargin &&
           truth_.v(x, y) <= static_cast<float>(projector_.height) - 1.0F - kMargin;
  }

  const MaskScene& scene_;
  const sim::ViewTruth& truth_;
  const CleanLight& light_;
  CameraModel projector_;
  double order_distance_;
};

}  // namespace fringe_fusion::bench
