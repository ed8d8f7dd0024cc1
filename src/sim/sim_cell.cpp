#include "fringe_fusion/sim/sim_cell.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/constants.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "interreflection.hpp"
#include "random.hpp"
#include "sensor.hpp"
#include "truth.hpp"

namespace fringe_fusion::sim {
namespace {

// Light sources during one exposure, relative to their mean.
struct FrameLight {
  double projector = 1.0;
  double ambient = 1.0;
};

// Mean of 1 + ratio sin(2 pi hz t + phase) over an exposure about `middle_s`.
double MeanLight(double ratio, double hz, double phase_rad, double middle_s, double exposure_s) {
  if (!(ratio > 0.0)) return 1.0;
  const double half = kPi * hz * exposure_s;
  return 1.0 + ratio * std::sin(half) / half * std::sin(2.0 * kPi * hz * middle_s + phase_rad);
}

// What the axes do wrong at one stop: T_object_camera = PoseError * commanded * arm error.
Transform AddPoseError(const SimConfig& config, const Transform& commanded, int pose_index) {
  const RandomStream random(RandomUse::kPoseError, {config.seed, pose_index});
  const auto draw = [&](std::uint64_t counter, double sigma) {
    return sigma * static_cast<double>(random.Gaussian(counter));
  };
  Transform turntable = Transform::Identity();
  turntable.linear() = ExpRotation(
      Eigen::Vector3d(0.0, 0.0, draw(0, kRadPerDeg * config.turntable_angle_sigma_deg)));
  turntable.translation() = Eigen::Vector3d(draw(1, 1e-3 * config.turntable_shift_sigma_mm),
                                            draw(2, 1e-3 * config.turntable_shift_sigma_mm), 0.0);
  Vector6d arm;
  for (int i = 0; i < 3; ++i) {
    const auto counter = static_cast<std::uint64_t>(i);
    arm[i] = draw(3 + counter, kRadPerDeg * config.arm_rotation_sigma_deg);
    arm[3 + i] = draw(6 + counter, 1e-3 * config.arm_translation_sigma_mm);
  }
  return turntable * commanded * Exp(arm);
}

}  // namespace

struct SimCell::Impl {
  Impl(const SimConfig& config_in, const CellCalibration& calibration_in, RayScene scene_in,
       const std::optional<SurfacePrint>& print)
      : config(config_in),
        calibration(calibration_in),
        scene(std::move(scene_in)),
        rays(PixelRays(calibration_in.camera)) {
    if (print) texture.emplace(*print);
  }

  [[nodiscard]] Shader MakeShader(const Transform& T) const {
    return {config, calibration, scene, T, texture ? &*texture : nullptr};
  }

  void Cast(const Transform& T) {
    const Shader shader = MakeShader(T);
    view = CastView(scene, shader, calibration.camera, rays, T);
    bounce =
        config.interreflection ? Interreflection(scene, shader, view, rays, T) : Interreflection();
  }

  // A shaking object shows other points to every pixel in every frame, so the rays are cast anew.
  void Shake(int frame_index) {
    if (!(config.vibration_mm > 0.0)) return;
    const RandomStream random(RandomUse::kVibration, {config.seed, pose_index, frame_index});
    Transform shaken = T_object_camera;
    for (int i = 0; i < 3; ++i) {
      const double sigma_m = 1e-3 * config.vibration_mm;
      shaken.translation()[i] -=
          sigma_m * static_cast<double>(random.Gaussian(static_cast<std::uint64_t>(i)));
    }
    Cast(shaken);
  }

  [[nodiscard]] Image<float> Radiance(const Image<std::uint8_t>& projected,
                                      const FrameLight& light) const;
  [[nodiscard]] std::int64_t StampNs(double exposure_s, int frame_index) const;
  [[nodiscard]] FrameLight LightOfFrame(double exposure_s, int frame_index) const;
  [[nodiscard]] Status CheckExposure(const Image<std::uint8_t>& projected, double exposure_s) const;

  [[nodiscard]] bool Fault(std::uint64_t kind, double probability, int frame_index) const {
    const RandomStream random(RandomUse::kFault, {config.seed, pose_index, frame_index});
    return random.Uniform(kind) < probability;
  }

  SimConfig config;
  CellCalibration calibration;
  RayScene scene;
  std::optional<PrintTexture> texture;
  Image<Eigen::Vector2d> rays;
  Transform T_object_camera = Transform::Identity();
  int pose_index = -1;
  ViewSamples view;
  Interreflection bounce;
  std::optional<FramePixels> previous;
};

Image<float> SimCell::Impl::Radiance(const Image<std::uint8_t>& projected,
                                     const FrameLight& frame_light) const {
  const float max_defocus = view.max_defocus_px2;
  const ProjectedLight light(config, ScalePicture(projected, config.panel_scale),
                             static_cast<double>(max_defocus));
  Image<float> irradiance;
  if (config.interreflection) irradiance = bounce.Irradiance(light, max_defocus);
  const auto ambient = static_cast<float>(config.ambient_ratio * frame_light.ambient);
  const auto gain = static_cast<float>(frame_light.projector);
  const auto shade = [&](const SurfaceSample& sample, std::size_t pixel) {
    const float indirect = ambient + (irradiance.empty() ? 0.0F : gain * irradiance[pixel]);
    const float reflected = sample.albedo * indirect;
    if (!sample.lit) return reflected;
    const float level = ProjectedLight::Level(sample.defocus_px2, max_defocus);
    return reflected + gain * sample.direct * light.Sample(sample.u, sample.v, level);
  };
  Image<float> radiance(view.centers.width(), view.centers.height());
  ParallelFor(static_cast<int>(radiance.size()), 16384, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      radiance[i] = shade(view.centers[i], i);
    }
  });
  ParallelFor(static_cast<int>(view.edges.size()), 1024, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      const auto pixel = static_cast<std::size_t>(view.edges[i].pixel);
      const auto first = static_cast<std::size_t>(view.edges[i].first);
      float sum = 0.0F;
      for (std::size_t k = first; k < first + kEdgeSamples; ++k) {
        sum += shade(view.edge_samples[k], pixel);
      }
      radiance[pixel] = sum / static_cast<float>(kEdgeSamples);
    }
  });
  return GaussianBlur(radiance, config.camera_blur_px, true);
}

std::int64_t SimCell::Impl::StampNs(double exposure_s, int frame_index) const {
  // Room for a thousand frames between poses; a longer exposure slows the camera down.
  const double period_s = std::max(config.frame_period_s, exposure_s);
  double frames = 1000.0 * pose_index + frame_index + 0.5;
  if (Fault(2, config.late_probability, frame_index)) frames += 1.5;
  return std::llround(1e9 * period_s * frames);
}

FrameLight SimCell::Impl::LightOfFrame(double exposure_s, int frame_index) const {
  const double period_s = std::max(config.frame_period_s, exposure_s);
  const double middle_s = period_s * (1000.0 * pose_index + frame_index + 0.5);
  const RandomStream random(RandomUse::kLight, {config.seed});
  FrameLight light;
  light.projector = MeanLight(config.projector_ripple_ratio, config.projector_frame_hz,
                              2.0 * kPi * random.Uniform(0), middle_s, exposure_s);
  light.ambient = MeanLight(config.ambient_flicker_ratio, config.ambient_flicker_hz,
                            2.0 * kPi * random.Uniform(1), middle_s, exposure_s);
  return light;
}

Status SimCell::Impl::CheckExposure(const Image<std::uint8_t>& projected, double exposure_s) const {
  const CameraModel& projector = calibration.projector;
  if (pose_index < 0) return Fail("simulated camera: no pose yet, call MoveTo first");
  if (projected.width() != projector.width || projected.height() != projector.height) {
    return Fail("simulated projector: picture is {} x {}, must be {} x {}", projected.width(),
                projected.height(), projector.width, projector.height);
  }
  if (!(exposure_s > 0.0) || !std::isfinite(exposure_s)) {
    return Fail("simulated camera: exposure {} s must be positive", exposure_s);
  }
  return {};
}

SimCell::SimCell(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SimCell::SimCell(SimCell&&) noexcept = default;
SimCell& SimCell::operator=(SimCell&&) noexcept = default;
SimCell::~SimCell() = default;

Result<SimCell> SimCell::Create(const SimConfig& config, const CellCalibration& calibration,
                                const Mesh& object, const Mesh& background,
                                const std::optional<SurfacePrint>& print) {
  Status status = CheckBounds(config, "sim");
  if (status && config.bit_depth != 8 && config.bit_depth != 12) {
    status = Fail("sim: bit_depth = {} must be 8 or 12", config.bit_depth);
  }
  if (status) status = Validate(calibration, "sim: calibration");
  if (!status) return tl::unexpected<Error>(status.error());
  Result<RayScene> scene = RayScene::Create(object, background);
  if (!scene) return Forward(scene);
  return SimCell(std::make_unique<Impl>(config, calibration, std::move(*scene), print));
}

Status SimCell::MoveTo(const Transform& T_object_camera_commanded, int pose_index) {
  if (!T_object_camera_commanded.matrix().allFinite()) {
    return Fail("simulated motion: pose {} has a value that is not finite", pose_index);
  }
  if (pose_index < 0) return Fail("simulated motion: pose index {} must be at least 0", pose_index);
  impl_->pose_index = pose_index;
  impl_->T_object_camera = AddPoseError(impl_->config, T_object_camera_commanded, pose_index);
  impl_->Cast(impl_->T_object_camera);
  return {};
}

Result<CapturedFrame> SimCell::Expose(const Image<std::uint8_t>& projected, double exposure_s,
                                      int frame_index) {
  if (const Status status = impl_->CheckExposure(projected, exposure_s); !status) {
    return tl::unexpected<Error>(status.error());
  }
  const SimConfig& config = impl_->config;
  if (impl_->Fault(0, config.drop_probability, frame_index)) {
    return Fail("simulated camera: frame {} of pose {} was dropped", frame_index,
                impl_->pose_index);
  }
  CapturedFrame frame;
  frame.bit_depth = config.bit_depth;
  frame.exposure_s = exposure_s;
  frame.stamp_ns = impl_->StampNs(exposure_s, frame_index);
  if (impl_->previous && impl_->Fault(1, config.duplicate_probability, frame_index)) {
    frame.pixels = *impl_->previous;
    return frame;
  }
  impl_->Shake(frame_index);
  const RandomStream noise(RandomUse::kPixelNoise, {config.seed, impl_->pose_index, frame_index});
  frame.pixels =
      sim::Expose(config, impl_->Radiance(projected, impl_->LightOfFrame(exposure_s, frame_index)),
                  exposure_s / config.exposure_reference_s, noise);
  if (config.duplicate_probability > 0.0) impl_->previous = frame.pixels;
  return frame;
}

ViewTruth SimCell::Truth() const {
  const Impl& impl = *impl_;
  const Shader shader = impl.MakeShader(impl.T_object_camera);
  // After a vibration the kept rays are those of the last frame; the truth is that of the rest.
  if (impl.config.vibration_mm > 0.0) {
    return MakeTruth(
        impl.scene, impl.calibration,
        CastView(impl.scene, shader, impl.calibration.camera, impl.rays, impl.T_object_camera),
        impl.rays, impl.T_object_camera);
  }
  return MakeTruth(impl.scene, impl.calibration, impl.view, impl.rays, impl.T_object_camera);
}

const CellCalibration& SimCell::calibration() const { return impl_->calibration; }
const SimConfig& SimCell::config() const { return impl_->config; }

}  // namespace fringe_fusion::sim
