#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>

#include "common/constants.hpp"
#include "common/median.hpp"
#include "fringe_fusion/diagnosis/capture_assistant.hpp"
#include "fringe_fusion/diagnosis/sensor_noise.hpp"
#include "fringe_fusion/triangulation/range_image.hpp"
#include "stack_sampling.hpp"

namespace fringe_fusion {
namespace {

using diagnosis::SampledStack;

constexpr double kSameExposure = 1e-6;  // relative
constexpr double kMinContrastSigma = 5.0;
constexpr double kReach = 2.0;            // of the least modulation
constexpr double kMinAxisRatio = 0.3;     // an axis that moves less says nothing of the depth
constexpr double kMinFringeSigma = 20.0;  // a brighter pixel tells its modulation without bias

/// The frames of one exposure.
struct Exposure {
  double exposure_s = 0.0;
  ImageStack stack;
  diagnosis::SequencePlan plan;
  SampledStack samples;
  Image<float> white;
  Image<float> black;
};

Status CheckFrames(const ImageStack& test, const CellCalibration& calibration) {
  if (Status status = Validate(test, "test exposures"); !status) return status;
  if (Status status = Validate(calibration, "test exposures"); !status) return status;
  const CameraModel& camera = calibration.camera;
  const CapturedFrame& first = test.frames.front();
  if (Width(first) != camera.width || Height(first) != camera.height) {
    return Fail("test exposures: frames of {} x {} px, but the calibrated camera has {} x {} px",
                Width(first), Height(first), camera.width, camera.height);
  }
  for (std::size_t i = 0; i < test.frames.size(); ++i) {
    if (!(test.frames[i].exposure_s > 0.0)) {
      return Fail("test exposures: frame {} does not state its exposure time", i);
    }
    if (test.frames[i].gain != first.gain) {
      return Fail("test exposures: frame {} was taken at gain {:g}, frame 0 at {:g}: use one gain",
                  i, test.frames[i].gain, first.gain);
    }
  }
  return {};
}

void AddFrame(const ImageStack& test, std::size_t i, std::vector<Exposure>& exposures) {
  const double exposure_s = test.frames[i].exposure_s;
  auto same = std::find_if(exposures.begin(), exposures.end(), [&](const Exposure& exposure) {
    return std::abs(exposure.exposure_s - exposure_s) < kSameExposure * exposure_s;
  });
  if (same == exposures.end()) {
    same = exposures.insert(exposures.end(), Exposure{});
    same->exposure_s = exposure_s;
    same->stack.sequence.width = test.sequence.width;
    same->stack.sequence.height = test.sequence.height;
  }
  same->stack.sequence.frames.push_back(test.sequence.frames[i]);
  same->stack.sequence.frames.back().exposure_ratio = 1.0;
  same->stack.frames.push_back(test.frames[i]);
}

// By rising exposure; one without white or black says nothing of the contrast.
Result<std::vector<Exposure>> SplitByExposure(const ImageStack& test) {
  std::vector<Exposure> all;
  for (std::size_t i = 0; i < test.frames.size(); ++i) AddFrame(test, i, all);
  std::vector<Exposure> exposures;
  for (Exposure& exposure : all) {
    exposure.plan = diagnosis::MakeSequencePlan(exposure.stack.sequence);
    if (exposure.plan.white_frames.empty() || exposure.plan.black_frames.empty()) continue;
    const DiagnosisConfig sampling;
    Result<SampledStack> samples = diagnosis::SampleStack(exposure.stack, sampling.max_samples);
    if (!samples) return Forward(samples);
    exposure.samples = std::move(*samples);
    exposure.white = MeanOfFrames(exposure.samples, exposure.plan.white_frames);
    exposure.black = MeanOfFrames(exposure.samples, exposure.plan.black_frames);
    exposures.push_back(std::move(exposure));
  }
  if (exposures.empty()) return Fail("test exposures: no exposure has both a white and a black");
  std::sort(exposures.begin(), exposures.end(),
            [](const Exposure& a, const Exposure& b) { return a.exposure_s < b.exposure_s; });
  return exposures;
}

// Levels of two sets are compared, so each exposure is estimated for itself; the surest counts.
void MeasureNoise(const std::vector<Exposure>& exposures, const PhaseConfig& phase,
                  CaptureScene& scene) {
  scene.read_noise_dn = phase.read_noise_dn;
  scene.gain_dn = phase.gain_dn;
  double least_sigma = std::numeric_limits<double>::infinity();
  for (const Exposure& exposure : exposures) {
    const auto noise = EstimateSensorNoise(exposure.stack, DiagnosisConfig{});
    if (!noise || !(noise->sigma_gain_dn < least_sigma)) continue;
    least_sigma = noise->sigma_gain_dn;
    scene.read_noise_dn = noise->read_noise_dn;
    scene.gain_dn = noise->gain_dn;
    scene.measured_noise = true;
  }
}

/// Light of every sample of the grid.
struct Light {
  Image<float> contrast_dn_s;  ///< 0: not visible
  Image<float> black_dn_s;
  int num_saturated = 0;
};

Light MeasureLight(const std::vector<Exposure>& exposures, const PhaseConfig& phase,
                   const CaptureAssistantConfig& config, const CaptureScene& scene) {
  const Exposure& shortest = exposures.front();
  const double limit = phase.saturation_ratio * scene.full_scale_dn;
  const double floor_dn2 = scene.read_noise_dn * scene.read_noise_dn + 1.0 / 12.0;
  Light light{Image<float>(shortest.white.width(), shortest.white.height()),
              Image<float>(shortest.white.width(), shortest.white.height()), 0};
  for (std::size_t i = 0; i < light.contrast_dn_s.size(); ++i) {
    double tt = 0.0;
    double contrast = 0.0;
    double black = 0.0;
    double variance = 0.0;
    const auto add = [&](const Exposure& exposure) {
      const double t = exposure.exposure_s;
      const auto white_dn = static_cast<double>(exposure.white[i]);
      const auto black_dn = static_cast<double>(exposure.black[i]);
      tt += t * t;
      contrast += t * (white_dn - black_dn);
      black += t * black_dn;
      variance += t * t * (2.0 * floor_dn2 + scene.gain_dn * (white_dn + black_dn));
    };
    for (const Exposure& exposure : exposures) {
      if (static_cast<double>(exposure.white[i]) < limit) add(exposure);
    }
    const bool saturated = tt == 0.0;
    if (saturated) add(shortest);
    if (!(contrast > kMinContrastSigma * std::sqrt(variance))) continue;
    // What the longest exposure leaves without fringes is out of reach.
    const double white_dn = config.max_exposure_s * (contrast + black) / tt;
    const double b_dn = 0.5 * config.max_exposure_s * contrast / tt;
    const double sigma_dn = std::sqrt(floor_dn2 + scene.gain_dn * white_dn);
    if (!(b_dn > kReach * phase.min_modulation_sigma * sigma_dn)) continue;
    if (!(2.0 * b_dn > phase.min_contrast_dn)) continue;
    light.contrast_dn_s[i] = static_cast<float>(contrast / tt);
    light.black_dn_s[i] = static_cast<float>(black / tt);
    light.num_saturated += saturated ? 1 : 0;
  }
  return light;
}

/// Fringe amplitude and mean level of one frequency, of white minus black.
struct Modulation {
  int axis = 0;
  double fringes = 0.0;
  double ratio = 0.0;
  double mean_ratio = 0.0;
};

std::optional<Modulation> MeasureModulation(const Exposure& exposure, const diagnosis::StepSet& set,
                                            const Light& light, const CaptureScene& scene,
                                            double saturation_dn) {
  const diagnosis::StepFit fit = FitSteps(exposure.samples, set);
  std::vector<double> ratios;
  std::vector<double> means;
  for (std::size_t i = 0; i < light.contrast_dn_s.size(); ++i) {
    const double contrast = static_cast<double>(light.contrast_dn_s[i]) * exposure.exposure_s;
    const auto white = static_cast<double>(exposure.white[i]);
    const double sigma =
        std::sqrt(scene.read_noise_dn * scene.read_noise_dn + 1.0 / 12.0 + scene.gain_dn * white);
    if (!(contrast > kMinFringeSigma * sigma) || !(white < saturation_dn)) continue;
    ratios.push_back(static_cast<double>(fit.modulation_dn[i]) / contrast);
    means.push_back(static_cast<double>(fit.offset_dn[i] - exposure.black[i]) / contrast);
  }
  if (ratios.size() < 100) return {};
  return Modulation{set.axis == Axis::kU ? 0 : 1, set.fringes, Median(std::move(ratios)),
                    Median(std::move(means))};
}

// ln(B / contrast) = ln(B_0 / contrast) - (2 pi f sigma / W)^2 / 2. Ref: science section 2.4.
void FitBlur(const std::vector<Modulation>& modulations, int axis, CaptureScene& scene) {
  double n = 0.0, sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;
  for (const Modulation& m : modulations) {
    if (m.axis != axis || !(m.ratio > 0.0)) continue;
    const double angle = kTwoPi * m.fringes / scene.size_px[static_cast<std::size_t>(axis)];
    const double x = -0.5 * angle * angle;
    const double y = std::log(m.ratio);
    n += 1.0;
    sx += x;
    sy += y;
    sxx += x * x;
    sxy += x * y;
  }
  const double spread = n * sxx - sx * sx;
  // A single frequency says nothing of the amplitude without blur: that of a linear cell.
  const bool one = !(spread > 1e-12 * n * sxx);
  const double slope = one ? (sy / n - std::log(0.5)) / (sx / n) : (n * sxy - sx * sy) / spread;
  const double variance_px2 = std::max(0.0, slope);
  scene.blur_px[static_cast<std::size_t>(axis)] = std::sqrt(variance_px2);
  scene.fringe_ratio = one ? 0.5 : std::exp((sy - variance_px2 * sx) / n);
}

void MeasureFringes(const std::vector<Exposure>& exposures, const Light& light,
                    const PhaseConfig& phase, const CaptureAssistantConfig& config,
                    CaptureScene& scene) {
  const double saturation_dn = phase.saturation_ratio * scene.full_scale_dn;
  std::vector<Modulation> modulations;
  std::vector<double> means;
  std::optional<ResponseCurve> response;
  for (const Exposure& exposure : exposures) {
    const std::size_t before = modulations.size();
    for (const diagnosis::StepSet& set : exposure.plan.sets) {
      const auto modulation = MeasureModulation(exposure, set, light, scene, saturation_dn);
      if (!modulation) continue;
      modulations.push_back(*modulation);
      means.push_back(modulation->mean_ratio);
    }
    if (modulations.size() == before) continue;
    // The longest exposure that most pixels survive has the least noise.
    if (auto curve = ResponseFromScan(exposure.stack, DiagnosisConfig{})) response = *curve;
  }
  scene.blur_px = {config.blur_px, config.blur_px};
  scene.response = response.value_or(PowerResponse(1.0));
  if (modulations.empty()) return;
  scene.measured_fringes = true;
  scene.mean_ratio = Median(means);
  for (const int axis : {0, 1}) {
    const bool has = std::any_of(modulations.begin(), modulations.end(),
                                 [axis](const Modulation& m) { return m.axis == axis; });
    FitBlur(modulations, has ? axis : 1 - axis, scene);
    if (!has) {
      scene.blur_px[static_cast<std::size_t>(axis)] =
          scene.blur_px[static_cast<std::size_t>(1 - axis)];
    }
  }
}

// Where the camera's axis passes the ray of the projector's middle pixel; 1 m where they part.
double NominalRange(const CellCalibration& calibration) {
  const Transform T_camera_projector = calibration.T_projector_camera.inverse();
  const CameraModel& projector = calibration.projector;
  const Eigen::Vector2d middle(0.5 * (projector.width - 1), 0.5 * (projector.height - 1));
  const Eigen::Vector3d ray =
      (T_camera_projector.linear() * Undistort(projector, middle).homogeneous()).normalized();
  const Eigen::Vector3d origin = T_camera_projector.translation();
  const Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  const double dot = axis.dot(ray);
  const double range = (axis.dot(origin) - dot * ray.dot(origin)) / (1.0 - dot * dot);
  return std::isfinite(range) && range > 0.0 ? range : 1.0;
}

// Derivative of the projector pixel by the range along a ray, science section 2.5.
Eigen::Vector2d PixelsPerMetre(const CellCalibration& calibration,
                               const Eigen::Vector3d& ray_camera, double range_m) {
  const Eigen::Vector3d point = calibration.T_projector_camera * (range_m * ray_camera);
  const Projection projection = ProjectWithJacobian(calibration.projector, point);
  return projection.jacobian * (calibration.T_projector_camera.linear() * ray_camera);
}

/// Range of every camera pixel as far as the test frames tell it.
class Ranges {
 public:
  Ranges(const ImageStack& test, const CellCalibration& calibration, const PhaseConfig& phase)
      : calibration_(calibration), nominal_m_(NominalRange(calibration)) {
    const auto map = DecodePhase(test, phase);
    if (!map) return;
    auto made = Triangulate(*map, calibration, TriangulationConfig{});
    if (!made) return;
    std::vector<double> ranges;
    for (const Eigen::Vector3f& point : made->range.points) {
      if (point.allFinite()) ranges.push_back(static_cast<double>(point.norm()));
    }
    if (ranges.empty()) return;
    nominal_m_ = Median(std::move(ranges));
    points_ = std::move(made->range.points);
  }

  [[nodiscard]] Eigen::Vector2d PixelsPerMetreAt(int x, int y) const {
    const Eigen::Vector3d ray =
        Undistort(calibration_.camera, Eigen::Vector2d(x, y)).homogeneous().normalized();
    const bool known = !points_.empty() && points_(x, y).allFinite();
    const double range_m = known ? static_cast<double>(points_(x, y).norm()) : nominal_m_;
    return PixelsPerMetre(calibration_, ray, range_m);
  }

 private:
  const CellCalibration& calibration_;
  double nominal_m_ = 1.0;
  Image<Eigen::Vector3f> points_;
};

double MeasureOverhead(const ImageStack& test) {
  std::vector<double> gaps;
  for (std::size_t i = 1; i < test.frames.size(); ++i) {
    const CapturedFrame& a = test.frames[i - 1];
    const CapturedFrame& b = test.frames[i];
    gaps.push_back(1e-9 * static_cast<double>(b.stamp_ns - a.stamp_ns) -
                   0.5 * (a.exposure_s + b.exposure_s));
  }
  return gaps.empty() ? 0.0 : std::max(0.0, Median(std::move(gaps)));
}

// Evenly spread over the visible samples.
void PickPixels(const Light& light, const Ranges& ranges, int stride, int max_samples,
                CaptureScene& scene) {
  std::vector<std::size_t> visible;
  for (std::size_t i = 0; i < light.contrast_dn_s.size(); ++i) {
    if (light.contrast_dn_s[i] > 0.0F) visible.push_back(i);
  }
  const std::size_t count = std::min(visible.size(), static_cast<std::size_t>(max_samples));
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = visible[(2 * k + 1) * visible.size() / (2 * count)];
    const auto width = static_cast<std::size_t>(light.contrast_dn_s.width());
    const int x = static_cast<int>(i % width) * stride;
    const int y = static_cast<int>(i / width) * stride;
    const Eigen::Vector2d px_per_m = ranges.PixelsPerMetreAt(x, y);
    if (!px_per_m.allFinite()) continue;
    scene.pixels.push_back({static_cast<double>(light.contrast_dn_s[i]),
                            static_cast<double>(light.black_dn_s[i]), px_per_m});
  }
  scene.num_visible = static_cast<int>(visible.size()) * stride * stride;
  scene.saturated_ratio =
      visible.empty() ? 0.0 : light.num_saturated / static_cast<double>(visible.size());
}

}  // namespace

Result<CaptureScene> MeasureCaptureScene(const ImageStack& test, const CellCalibration& calibration,
                                         const PhaseConfig& phase,
                                         const CaptureAssistantConfig& config) {
  Status status = CheckBounds(config, "capture_assistant");
  if (status) status = CheckBounds(phase, "phase");
  if (status) status = CheckFrames(test, calibration);
  if (!status) return tl::unexpected<Error>(status.error());
  const auto exposures = SplitByExposure(test);
  if (!exposures) return Forward(exposures);
  CaptureScene scene;
  scene.size_px = {test.sequence.width, test.sequence.height};
  scene.full_scale_dn = static_cast<double>(exposures->front().samples.full_scale_dn);
  scene.shortest_exposure_s = exposures->front().exposure_s;
  scene.frame_overhead_s =
      config.frame_overhead_s > 0.0 ? config.frame_overhead_s : MeasureOverhead(test);
  MeasureNoise(*exposures, phase, scene);
  const Light light = MeasureLight(*exposures, phase, config, scene);
  MeasureFringes(*exposures, light, phase, config, scene);
  const int stride = exposures->front().samples.stride;
  PickPixels(light, Ranges(test, calibration, phase), stride, config.max_samples, scene);
  if (scene.pixels.empty()) {
    return Fail(
        "test exposures: no pixel sees the projector: white minus black stays below {:g} DN at "
        "{:g} s, or even the longest exposure allowed, {:g} s, gives no fringes",
        phase.min_contrast_dn, exposures->back().exposure_s, config.max_exposure_s);
  }
  return scene;
}

PatternConfig TestPattern(const CellCalibration& calibration) {
  const CameraModel& camera = calibration.camera;
  const CameraModel& projector = calibration.projector;
  const Eigen::Vector2d middle(0.5 * (camera.width - 1), 0.5 * (camera.height - 1));
  const Eigen::Vector2d px_per_m = PixelsPerMetre(
      calibration, Undistort(camera, middle).homogeneous().normalized(), NominalRange(calibration));
  const double most = px_per_m.cwiseAbs().maxCoeff();
  PatternConfig pattern;
  pattern.axis_u = std::abs(px_per_m.x()) > kMinAxisRatio * most;
  pattern.axis_v = std::abs(px_per_m.y()) > kMinAxisRatio * most;
  const int finest = std::max(4, std::min(projector.width, projector.height) / 16);
  pattern.fringes =
      fmt::format("1,{},{}", static_cast<int>(std::lround(std::sqrt(finest))), finest);
  pattern.steps = 4;
  pattern.exposures = "0.25,1,4";
  return pattern;
}

}  // namespace fringe_fusion
