#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "fringe_fusion/sim/gauges.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"

// Scenes, cells and seeds on which the self-diagnosis is judged. They were fixed before any limit
// was chosen; limits are chosen on TuningSeeds alone.
namespace fringe_fusion::bench {

/// Faults that can be injected, one at a time.
enum class Fault {
  kNone,
  kResponse,
  kShifted,
  kDropped,
  kDuplicated,
  kSwapped,
  kExposure,
  kSaturation,
  kTooDark,
  kMotion,
  kProjectorDefocus,
  kCameraDefocus,
  kFlicker,
  kInterreflection,
  kResolution,
};
constexpr int kNumFaults = 15;
constexpr int kNumStrengths = 3;

/// One scanner before one object.
struct DiagnosisScene {
  sim::SimConfig config;
  CellCalibration calibration;
  PatternConfig pattern;
  Mesh object;
  Mesh background;
  Transform T_object_camera = Transform::Identity();
  int seed = 0;
};

constexpr int kNumFaultScenes = 24;
constexpr int kNumCleanScenes = 320;
constexpr int FaultSeed(int scene) { return 500009 + 31 * scene; }   // evaluation
constexpr int CleanSeed(int scene) { return 700001 + 37 * scene; }   // evaluation
constexpr int TuningSeed(int scene) { return 100001 + 17 * scene; }  // choosing limits

/// Uniform numbers that are the same with every standard library.
class Draw {
 public:
  explicit Draw(int seed) : engine_(static_cast<unsigned>(seed)) { engine_.discard(16); }
  double operator()(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_()) + 0.5) / 4294967296.0;
  }
  int Pick(int count) { return static_cast<int>((*this)(0.0, count)); }

 private:
  std::mt19937 engine_;
};

/// Two square walls of side_m that meet in the y axis of `object` at opening_rad, the inside up.
inline Mesh MakeCorner(double side_m, double opening_rad) {
  constexpr int kCells = 24;
  Mesh mesh;
  for (const double side : {-1.0, 1.0}) {
    const auto first = static_cast<int>(mesh.vertices.size());
    for (int j = 0; j <= kCells; ++j) {
      for (int i = 0; i <= kCells; ++i) {
        const double along = side_m * i / kCells;
        const double across = side_m * (static_cast<double>(j) / kCells - 0.5);
        mesh.vertices.emplace_back(Eigen::Vector3d(side * along * std::sin(0.5 * opening_rad),
                                                   across, along * std::cos(0.5 * opening_rad))
                                       .cast<float>());
      }
    }
    for (int j = 0; j < kCells; ++j) {
      for (int i = 0; i < kCells; ++i) {
        const int a = first + j * (kCells + 1) + i;
        const int b = a + kCells + 1;
        mesh.faces.emplace_back(a, side > 0.0 ? a + 1 : b, side > 0.0 ? b : a + 1);
        mesh.faces.emplace_back(b + 1, side > 0.0 ? b : a + 1, side > 0.0 ? a + 1 : b);
      }
    }
  }
  return mesh;
}

/// Camera of 400 x 300, projector of 640 x 400 pixels: the default scanner with half the pixels.
inline CellCalibration DiagnosisCalibration() {
  CellCalibration calibration = sim::DefaultCalibration();
  for (CameraModel* model : {&calibration.camera, &calibration.projector}) {
    model->width /= 2;
    model->height /= 2;
    model->fx /= 2.0;
    model->fy /= 2.0;
    model->cx = (model->cx + 0.5) / 2.0 - 0.5;
    model->cy = (model->cy + 0.5) / 2.0 - 0.5;
  }
  return calibration;
}

inline Mesh MakeDiagnosisObject(int kind, Draw& draw) {
  switch (kind) {
    case 0:
      return sim::MakeFreeform(2e-3);
    case 1:
      return sim::MakeStepBlock(2 + draw.Pick(4), draw(0.006, 0.012), draw(0.012, 0.018), 0.07);
    case 2:
      return sim::MakeSphere({0.0, 0.0, 0.035}, draw(0.025, 0.035), 4);
    case 3:
      return sim::MakeBallBar(draw(0.05, 0.08), 0.016);
    default:
      return MakeCorner(0.06, draw(1.4, 2.2));
  }
}

inline PatternConfig MakeDiagnosisPattern(int kind) {
  constexpr std::array<const char*, 4> kFringes{"1,6,32", "1,5,25", "1,6,36", "1,7,28"};
  constexpr std::array<int, 4> kSteps{4, 5, 6, 4};
  PatternConfig pattern;
  pattern.fringes = kFringes[static_cast<std::size_t>(kind)];
  pattern.steps = kSteps[static_cast<std::size_t>(kind)];
  return pattern;
}

inline void DrawDevices(Draw& draw, sim::SimConfig& config) {
  config.projector_black_ratio = draw(0.001, 0.01);
  config.projector_blur_px = draw(0.4, 0.8);
  config.albedo = draw(0.5, 0.9);
  config.texture_contrast = draw.Pick(3) == 0 ? draw(0.2, 0.5) : 0.0;
  config.texture_period_m = draw(0.008, 0.02);
  config.specular_ratio = draw.Pick(3) == 0 ? draw(0.05, 0.25) : 0.0;
  config.ambient_ratio = draw(0.01, 0.1);
  config.camera_blur_px = draw(0.3, 0.6);
  config.bit_depth = draw.Pick(3) == 0 ? 12 : 8;
  const double scale = config.bit_depth == 12 ? 16.0 : 1.0;
  config.gain_dn = scale * draw(0.02, 0.08);
  config.read_noise_dn = scale * draw(0.5, 1.3);
  config.exposure_reference_s = 0.02;
  config.frame_period_s = 0.0413;
}

/// The scene of a seed. The interreflection needs a concave object; faults do not change the rest.
inline DiagnosisScene MakeDiagnosisScene(int seed, Fault fault) {
  Draw draw(seed);
  DiagnosisScene scene;
  scene.seed = seed;
  scene.config.seed = seed;
  scene.calibration = DiagnosisCalibration();
  DrawDevices(draw, scene.config);
  scene.pattern = MakeDiagnosisPattern(draw.Pick(4));
  const int kind = draw.Pick(5);
  scene.object = MakeDiagnosisObject(fault == Fault::kInterreflection ? 4 : kind, draw);
  const bool corner = fault == Fault::kInterreflection || kind == 4;
  if (!corner && draw.Pick(4) != 0) scene.background = sim::MakePlate(0.07, 0.005);
  const double elevation = corner ? draw(55.0, 80.0) : draw(20.0, 50.0);
  scene.T_object_camera =
      sim::TurntablePose(draw.Pick(360), 360, draw(0.47, 0.53), elevation, {0.0, 0.0, 0.03});
  return scene;
}

/// Blur sigma [px of the pattern] that leaves exp(-x^2 / 2) of the finest fringes.
inline double BlurOf(const DiagnosisScene& scene, double x) {
  const std::string& list = scene.pattern.fringes;
  const double fringes = std::stod(list.substr(list.rfind(',') + 1));
  return x * scene.calibration.projector.width / (2.0 * 3.14159265358979323846 * fringes);
}

/// What a fault of a scene does to the devices. @param strength 0..2, rising.
inline void InjectIntoDevices(Fault fault, int strength, DiagnosisScene& scene) {
  using Levels = std::array<double, kNumStrengths>;
  const auto level = [&](const Levels& levels) {
    return levels[static_cast<std::size_t>(strength)];
  };
  sim::SimConfig& config = scene.config;
  if (fault == Fault::kResponse) config.projector_gamma = level({1.3, 1.8, 2.4});
  if (fault == Fault::kExposure) config.projector_ripple_ratio = level({0.06, 0.2, 0.6});
  if (fault == Fault::kMotion) config.vibration_mm = level({0.03, 0.1, 0.3});
  if (fault == Fault::kProjectorDefocus) {
    config.projector_blur_px = BlurOf(scene, level({1.2, 1.6, 2.0}));
  }
  if (fault == Fault::kCameraDefocus) config.camera_blur_px = level({1.8, 2.5, 3.5});
  if (fault == Fault::kFlicker) {
    config.ambient_ratio = std::max(config.ambient_ratio, 0.2);
    config.ambient_flicker_ratio = level({0.3, 0.6, 1.0});
  }
  if (fault == Fault::kInterreflection) {
    config.interreflection = true;
    config.albedo = level({0.65, 0.78, 0.92});
    config.texture_contrast = 0.0;
  }
  if (fault == Fault::kResolution) config.panel_scale = level({0.95, 1.2, 0.8});
}

/// Grey value over full scale that a tenth of the lit pixels exceed in the white picture at 20 ms.
inline double WhiteLevel(sim::SimCell& cell) {
  const CameraModel& projector = cell.calibration().projector;
  const Image<std::uint8_t> white(projector.width, projector.height, 255);
  const Result<CapturedFrame> frame = cell.Expose(white, 0.02, 0);
  if (!frame) throw std::runtime_error(frame.error().message);
  std::vector<double> levels;
  std::visit([&](const auto& pixels) { levels.assign(pixels.begin(), pixels.end()); },
             frame->pixels);
  std::sort(levels.begin(), levels.end());
  const double floor = 0.2 * levels[levels.size() - levels.size() / 500];
  const auto lit = static_cast<std::size_t>(levels.end() -
                                            std::upper_bound(levels.begin(), levels.end(), floor));
  return levels[levels.size() - 1 - lit / 10] / ((1 << frame->bit_depth) - 1);
}

/// Exposure time of a scene with a fault [s]. Lamp and projector are seen for whole periods unless
/// the fault is that they are not. What saturates depends on the part: an exposure is too long when
/// its bright parts do.
inline double ExposureOf(Fault fault, int strength, sim::SimCell& cell) {
  constexpr std::array<double, kNumStrengths> kBright{1.1, 1.6, 2.4};  // of full scale
  constexpr std::array<double, kNumStrengths> kDark{0.1, 0.05, 0.025};
  if (fault == Fault::kSaturation) {
    return 0.02 * kBright[static_cast<std::size_t>(strength)] / WhiteLevel(cell);
  }
  if (fault == Fault::kTooDark) return 0.02 * kDark[static_cast<std::size_t>(strength)];
  if (fault == Fault::kExposure) return 0.0217;
  if (fault == Fault::kFlicker) return 0.0137;
  return 0.02;
}

/// Which pattern each frame of the sequence shows.
inline std::vector<int> ShownPatterns(Fault fault, int strength, int num_frames, int seed) {
  Draw draw(seed + 5);
  std::vector<int> shown(static_cast<std::size_t>(num_frames));
  for (int i = 0; i < num_frames; ++i) shown[static_cast<std::size_t>(i)] = i;
  const int k = 3 + draw.Pick(num_frames - 7);
  const auto at = [&](int i) -> int& { return shown[static_cast<std::size_t>(i)]; };
  if (fault == Fault::kShifted) {
    constexpr std::array<int, kNumStrengths> kLag{1, -1, 2};
    const int lag = kLag[static_cast<std::size_t>(strength)];
    for (int i = 0; i < num_frames; ++i) at(i) = (i - lag + num_frames) % num_frames;
  }
  if (fault == Fault::kDropped) {
    for (int i = k; i + 1 < num_frames; ++i) at(i) = i + 1;
    // The projector holds its last picture, starts again, or goes black.
    constexpr std::array<int, kNumStrengths> kLast{-2, 0, -1};
    const int last = kLast[static_cast<std::size_t>(strength)];
    at(num_frames - 1) = last == -2 ? num_frames - 1 : last;
  }
  if (fault == Fault::kDuplicated) {
    at(k) = k - 1;
    if (strength == 1) {
      for (int i = k; i < num_frames; ++i) at(i) = i - 1;
    }
  }
  if (fault == Fault::kSwapped) {
    const int other = strength == 0 ? k + 1 : strength == 1 ? k + 2 : (k + num_frames / 2 - 3);
    std::swap(at(k), at(3 + (other - 3) % (num_frames - 4)));
  }
  return shown;
}

/// The stack of a scene with one fault. For duplicates of strength 2 the camera hands out the same
/// pixels twice; otherwise the projector showed the same picture twice.
inline ImageStack CaptureWithFault(DiagnosisScene scene, Fault fault, int strength) {
  InjectIntoDevices(fault, strength, scene);
  const CameraModel& projector = scene.calibration.projector;
  const PatternSequence sequence =
      MakeSequence(scene.pattern, projector.width, projector.height).value();
  Result<sim::SimCell> cell =
      sim::SimCell::Create(scene.config, scene.calibration, scene.object, scene.background);
  if (!cell) throw std::runtime_error(cell.error().message);
  if (const Status status = cell->MoveTo(scene.T_object_camera, scene.seed % 97); !status) {
    throw std::runtime_error(status.error().message);
  }
  const std::vector<int> shown =
      ShownPatterns(fault, strength, static_cast<int>(sequence.frames.size()), scene.seed);
  Result<ImageStack> stack =
      CaptureMisordered(*cell, sequence, shown, ExposureOf(fault, strength, *cell), 0);
  if (!stack) throw std::runtime_error(stack.error().message);
  if (fault == Fault::kDuplicated && strength == 2) {
    for (std::size_t i = 1; i < shown.size(); ++i) {
      if (shown[i] == shown[i - 1]) stack->frames[i].pixels = stack->frames[i - 1].pixels;
    }
  }
  return std::move(*stack);
}

}  // namespace fringe_fusion::bench
