#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "common/constants.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/triangulation/range_image.hpp"
#include "ray_solver.hpp"

namespace fringe_fusion {
namespace {

using triangulation::Observation;
using triangulation::RayPoint;
using triangulation::RaySolver;

constexpr int kRowsPerChunk = 16;

bool HasSize(const Image<float>& image, const PhaseMap& phase) {
  return image.width() == phase.width && image.height() == phase.height;
}

Status CheckSizes(const PhaseMap& phase, const CellCalibration& calibration) {
  const CameraModel& camera = calibration.camera;
  if (phase.width != camera.width || phase.height != camera.height) {
    return Fail("triangulation: the phase map is {} x {}, but the calibrated camera is {} x {}",
                phase.width, phase.height, camera.width, camera.height);
  }
  if (phase.u.empty() && phase.v.empty()) {
    return Fail("triangulation: the phase map has neither u nor v");
  }
  if (phase.relative_u || phase.relative_v) {
    return Fail(
        "triangulation: {} is relative (one frequency, unwrapped over the image); code the axis by "
        "a second frequency or Gray code",
        phase.relative_u ? "u" : "v");
  }
  const bool u_fits = phase.u.empty() || (HasSize(phase.u, phase) && HasSize(phase.sigma_u, phase));
  const bool v_fits = phase.v.empty() || (HasSize(phase.v, phase) && HasSize(phase.sigma_v, phase));
  if (!u_fits || !v_fits || phase.mask.size() != phase.color.size() ||
      phase.mask.width() != phase.width || phase.mask.height() != phase.height) {
    return Fail("triangulation: an image of the phase map is not {} x {}", phase.width,
                phase.height);
  }
  return {};
}

Observation Observe(const PhaseMap& phase, int x, int y) {
  Observation out;
  out.pixel.setConstant(std::numeric_limits<double>::quiet_NaN());
  if (!phase.u.empty()) {
    out.pixel.x() = static_cast<double>(phase.u(x, y));
    out.sigma.x() = static_cast<double>(phase.sigma_u(x, y));
  }
  if (!phase.v.empty()) {
    out.pixel.y() = static_cast<double>(phase.v(x, y));
    out.sigma.y() = static_cast<double>(phase.sigma_v(x, y));
  }
  return out;
}

MaskReason Judge(const RayPoint& point, double range_m, const TriangulationConfig& config) {
  if (!point.converged || !(range_m >= config.min_range_m && range_m <= config.max_range_m)) {
    return MaskReason::kOutOfRange;
  }
  if (std::isnan(point.sigma_epipolar_px)) return MaskReason::kValid;
  const double limit = config.max_epipolar_sigma * point.sigma_epipolar_px + config.max_epipolar_px;
  return std::abs(point.epipolar_px) <= limit ? MaskReason::kValid : MaskReason::kEpipolar;
}

/// Fills one pixel of the result.
class PixelTriangulator {
 public:
  PixelTriangulator(const CellCalibration& calibration, const TriangulationConfig& config)
      : solver_(calibration),
        config_(config),
        ray_sigma_(config.lateral_sigma_px /
                   std::sqrt(calibration.camera.fx * calibration.camera.fy)) {}

  void Run(const PhaseMap& phase, const Eigen::Vector2f& ray, int x, int y,
           TriangulationResult& out) const {
    const Eigen::Vector2d ray_camera = ray.cast<double>();
    const RayPoint point = solver_.Solve(ray_camera, Observe(phase, x, y));
    const double ray_length = std::sqrt(1.0 + ray_camera.squaredNorm());
    const MaskReason reason = Judge(point, point.depth_m * ray_length, config_);
    out.mask(x, y) = static_cast<std::uint8_t>(reason);
    if (point.converged) out.epipolar_residual_px(x, y) = static_cast<float>(point.epipolar_px);
    if (reason != MaskReason::kValid) return;
    out.range.points(x, y) = (point.depth_m * ray_camera.homogeneous()).cast<float>();
    out.range.sigma_range(x, y) = static_cast<float>(point.sigma_depth_m * ray_length);
    out.range.sigma_lateral(x, y) = static_cast<float>(point.depth_m * ray_sigma_);
  }

 private:
  RaySolver solver_;
  const TriangulationConfig& config_;
  double ray_sigma_ = 0.0;  ///< standard deviation of the normalised ray coordinates
};

// The middle of the absolute residuals of all pixels that were not discarded; 0 without any.
double MedianAbs(const Image<float>& residuals, const Image<std::uint8_t>& mask) {
  std::vector<float> values;
  values.reserve(residuals.size());
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    if (mask[i] == 0 && std::isfinite(residuals[i])) values.push_back(std::abs(residuals[i]));
  }
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return static_cast<double>(*middle);
}

void MarkLost(const RangeImage& range, MaskReason reason, Image<std::uint8_t>& mask) {
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] == 0 && !range.points[i].allFinite()) mask[i] = static_cast<std::uint8_t>(reason);
  }
}

TriangulationResult MakeResult(const PhaseMap& phase, const CellCalibration& calibration) {
  TriangulationResult out;
  out.range = MakeRangeImage(phase.width, phase.height);
  out.range.color = phase.color;
  out.range.first_stamp_ns = phase.first_stamp_ns;
  out.range.last_stamp_ns = phase.last_stamp_ns;
  out.range.line_of_sight.projector =
      calibration.T_projector_camera.inverse().translation().cast<float>();
  out.epipolar_residual_px = Image<float>(phase.width, phase.height, kNan);
  out.mask = phase.mask;
  return out;
}

}  // namespace

Image<Eigen::Vector2f> MakeRayTable(const CameraModel& camera) {
  Image<Eigen::Vector2f> rays(camera.width, camera.height, Eigen::Vector2f::Zero());
  ParallelFor(camera.height, kRowsPerChunk, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        rays(x, y) = Undistort(camera, Eigen::Vector2d(x, y)).cast<float>();
      }
    }
  });
  return rays;
}

Result<TriangulationResult> Triangulate(const PhaseMap& phase, const CellCalibration& calibration,
                                        const TriangulationConfig& config,
                                        const Progress& progress) {
  if (Status status = Validate(calibration, "triangulation"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return Triangulate(phase, calibration, MakeRayTable(calibration.camera), config, progress);
}

Result<TriangulationResult> Triangulate(const PhaseMap& phase, const CellCalibration& calibration,
                                        const Image<Eigen::Vector2f>& rays,
                                        const TriangulationConfig& config,
                                        const Progress& progress) {
  if (Status status = CheckBounds(config, "triangulation"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  // Negated so that NaN fails.
  if (!(config.min_range_m < config.max_range_m)) {
    return Fail("triangulation: min_range_m = {} must be below max_range_m = {}",
                config.min_range_m, config.max_range_m);
  }
  if (Status status = Validate(calibration, "triangulation"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  if (Status status = CheckSizes(phase, calibration); !status) {
    return tl::unexpected<Error>(status.error());
  }
  if (rays.width() != phase.width || rays.height() != phase.height) {
    return Fail("triangulation: the ray table is {} x {}, but the phase map is {} x {}",
                rays.width(), rays.height(), phase.width, phase.height);
  }
  if (!progress("triangulate", 0.0)) return Fail("{}", kCancelled);
  TriangulationResult out = MakeResult(phase, calibration);
  const PixelTriangulator triangulator(calibration, config);
  ParallelFor(phase.height, kRowsPerChunk, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < phase.width; ++x) {
        if (phase.mask(x, y) == 0) triangulator.Run(phase, rays(x, y), x, y, out);
      }
    }
  });
  if (!progress("triangulate", 0.5)) return Fail("{}", kCancelled);
  out.median_abs_epipolar_px = MedianAbs(out.epipolar_residual_px, out.mask);
  out.range = EstimateNormals(out.range, config);
  MarkLost(out.range, MaskReason::kEdge, out.mask);
  out.range = RemoveSpecks(out.range, config);
  MarkLost(out.range, MaskReason::kIsolated, out.mask);
  if (!progress("triangulate", 1.0)) return Fail("{}", kCancelled);
  return out;
}

}  // namespace fringe_fusion
