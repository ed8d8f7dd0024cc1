#include "fringe_fusion/pose/epipolar_health.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/constants.hpp"
#include "common/dense.hpp"
#include "epipolar_solver.hpp"
#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion {
namespace {

constexpr int kRowsPerChunk = 16;

bool IsUsable(const PhaseMap& phase, int x, int y) {
  return std::isfinite(phase.u(x, y)) && std::isfinite(phase.v(x, y)) &&
         phase.sigma_u(x, y) > 0.0F && phase.sigma_v(x, y) > 0.0F &&
         (phase.mask.empty() || phase.mask(x, y) == 0);
}

/// Signed distances and the same in deviations.
struct ResidualMaps {
  Image<float> px;
  Image<float> sigmas;
};

ResidualMaps MapResiduals(const PhaseMap& phase, const DevicePair& devices, const Transform& T) {
  ResidualMaps maps{Image<float>(phase.width, phase.height, kNan),
                    Image<float>(phase.width, phase.height, kNan)};
  ParallelFor(phase.height, kRowsPerChunk, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < phase.width; ++x) {
        if (!IsUsable(phase, x, y)) continue;
        Match match;
        match.anchor_px = {x, y};
        match.observed_px = {static_cast<double>(phase.u(x, y)),
                             static_cast<double>(phase.v(x, y))};
        match.covariance_px2(0, 0) = std::pow(static_cast<double>(phase.sigma_u(x, y)), 2);
        match.covariance_px2(1, 1) = std::pow(static_cast<double>(phase.sigma_v(x, y)), 2);
        const EpipolarResidual residual = ResidualOf(match, devices, T);
        maps.px(x, y) = static_cast<float>(residual.distance_px);
        maps.sigmas(x, y) = static_cast<float>(residual.distance_px / residual.sigma);
      }
    }
  });
  return maps;
}

double MedianOf(const Image<float>& values, bool absolute) {
  std::vector<double> finite;
  finite.reserve(values.size());
  for (const float value : values) {
    if (!std::isfinite(value)) continue;
    finite.push_back(static_cast<double>(absolute ? std::abs(value) : value));
  }
  return epipolar::MedianInPlace(finite);
}

/// 68 % quantile of the absolute medians of blocks: noise averages out, model error stays, and a
/// few blocks of false codes do not count. For Gaussian values it equals the rms.
double Systematic(const Image<float>& residuals, int block_px) {
  constexpr std::size_t kMinBlockPixels = 30;
  constexpr double kQuantile = 0.6827;
  std::vector<double> medians;
  std::vector<double> block;
  for (int y0 = 0; y0 < residuals.height(); y0 += block_px) {
    for (int x0 = 0; x0 < residuals.width(); x0 += block_px) {
      block.clear();
      for (int y = y0; y < std::min(y0 + block_px, residuals.height()); ++y) {
        for (int x = x0; x < std::min(x0 + block_px, residuals.width()); ++x) {
          const float value = residuals(x, y);
          if (std::isfinite(value)) block.push_back(static_cast<double>(value));
        }
      }
      if (block.size() < kMinBlockPixels) continue;
      medians.push_back(std::abs(epipolar::MedianInPlace(block)));
    }
  }
  if (medians.empty()) return MedianOf(residuals, true);
  std::sort(medians.begin(), medians.end());
  return medians[static_cast<std::size_t>(kQuantile * static_cast<double>(medians.size() - 1))];
}

std::string MotionWords(const RigMotion& motion) {
  const std::string amount = fmt::format("{:.3f} deg (baseline direction {:.3f} deg)",
                                         motion.turn_deg, motion.direction_deg);
  switch (motion.moved) {
    case MovedDevice::kNone:
      return "no motion of the devices is significant";
    case MovedDevice::kCamera:
      return "the camera has turned by " + amount;
    case MovedDevice::kProjector:
      return "the projector has turned by " + amount;
    case MovedDevice::kEither:
      return "camera or projector has turned by " + amount + "; which one cannot be told";
    case MovedDevice::kBoth:
      return "the devices have moved against each other by " + amount +
             "; both turned, or one was shifted";
  }
  return "";
}

void Judge(HealthReport& report, const HealthConfig& config) {
  const double value = report.systematic_px;
  // Negated so that NaN is an error.
  report.level = !(value <= config.error_px)  ? HealthLevel::kError
                 : !(value <= config.warn_px) ? HealthLevel::kWarn
                                              : HealthLevel::kOk;
  report.message = fmt::format("systematic distance to the epipolar lines {:.3f} px, limit {:.3f}",
                               value, config.warn_px);
  if (report.level == HealthLevel::kOk) return;
  if (!report.pose) {
    report.message += "; the pose cannot be estimated from this scan: " + report.pose_error;
    return;
  }
  if (report.refit_systematic_px > config.warn_px) {
    report.message += fmt::format(
        "; another pose leaves {:.3f} px: a lens, its focus or the "
        "object changed, or the decoding is at fault; calibrate again",
        report.refit_systematic_px);
    return;
  }
  report.message += "; " + MotionWords(report.motion) + "; tighten the mount and calibrate again";
}

/// Two conditions x = G (omega, d) that vanish when the projector turned about its own centre.
Eigen::Matrix<double, 2, 5> ProjectorConditions(const Transform& T) {
  const Eigen::Matrix3d R = T.linear();
  const Eigen::Vector3d t = T.translation().normalized();
  const Eigen::Vector3d centre = R.transpose() * t;  // minus the projector's direction
  Eigen::Matrix<double, 3, 5> change;
  change << -Hat(centre), -R.transpose() * TangentBasis(t);  // omega x c - R^T B d
  return TangentBasis(centre).transpose() * change;
}

/// Slope of a straight line with its standard deviation from the scatter about it.
struct Slope {
  double rate = 0.0;
  double sigma = std::numeric_limits<double>::infinity();
  double normal_score = 0.0;  ///< deviations of a normal variable that are as unlikely
};

Slope FitSlope(const std::vector<double>& times, const std::vector<double>& values) {
  const double n = static_cast<double>(times.size());
  Slope slope;
  if (times.size() < 3) return slope;
  double mean_t = 0.0;
  double mean_y = 0.0;
  for (std::size_t i = 0; i < times.size(); ++i) {
    mean_t += times[i] / n;
    mean_y += values[i] / n;
  }
  double tt = 0.0;
  double ty = 0.0;
  double yy = 0.0;
  for (std::size_t i = 0; i < times.size(); ++i) {
    tt += (times[i] - mean_t) * (times[i] - mean_t);
    ty += (times[i] - mean_t) * (values[i] - mean_y);
    yy += (values[i] - mean_y) * (values[i] - mean_y);
  }
  if (!(tt > 0.0)) return slope;
  slope.rate = ty / tt;
  const double dof = n - 2.0;
  slope.sigma = std::sqrt(std::max(0.0, yy - slope.rate * ty) / dof / tt);
  // Few scans: Student's t to a normal deviate (Wallace 1959).
  const double ratio = slope.rate / std::max(slope.sigma, 1e-300);
  slope.normal_score =
      std::sqrt(dof * std::log1p(ratio * ratio / dof)) * (8.0 * dof + 1.0) / (8.0 * dof + 3.0);
  return slope;
}

}  // namespace

const char* HealthLevelName(HealthLevel level) {
  switch (level) {
    case HealthLevel::kOk:
      return "ok";
    case HealthLevel::kWarn:
      return "warn";
    case HealthLevel::kError:
      return "error";
  }
  return "unknown";
}

const char* MovedDeviceName(MovedDevice device) {
  switch (device) {
    case MovedDevice::kNone:
      return "none";
    case MovedDevice::kCamera:
      return "camera";
    case MovedDevice::kProjector:
      return "projector";
    case MovedDevice::kEither:
      return "either";
    case MovedDevice::kBoth:
      return "both";
  }
  return "unknown";
}

RigMotion CompareWithReference(const RelativePose& pose,
                               const Transform& T_projector_camera_reference,
                               const HealthConfig& config) {
  // Quantiles of chi2 (2 and 5 dof) at the two-sided probability of alarm_sigma deviations.
  const double tail = std::erfc(config.alarm_sigma / std::sqrt(2.0));
  const double limit2 = -2.0 * std::log(tail);
  const Eigen::Vector3d t = T_projector_camera_reference.translation().normalized();
  epipolar::Vector5d x;
  x.head<3>() = LogRotation(T_projector_camera_reference.linear().transpose() *
                            pose.T_observed_anchor.linear());
  // A small change: the bases of both ends agree to first order once turned into the same one.
  const Matrix32d basis = TangentBasis(t);
  x.tail<2>() = basis.transpose() * pose.T_observed_anchor.translation();
  Matrix5d turn = Matrix5d::Identity();
  turn.bottomRightCorner<2, 2>() =
      basis.transpose() * TangentBasis(pose.T_observed_anchor.translation());
  const Matrix5d covariance = turn * pose.covariance * turn.transpose();

  RigMotion motion;
  motion.turn_deg = kDegPerRad * x.head<3>().norm();
  motion.direction_deg = kDegPerRad * x.tail<2>().norm();
  motion.significance = std::sqrt(x.dot(epipolar::Vector5d(dense::SolveSymmetric(covariance, x))));
  const Eigen::Vector2d d = x.tail<2>();
  motion.camera_chi2 = d.dot(covariance.bottomRightCorner<2, 2>().inverse() * d);
  const Eigen::Matrix<double, 2, 5> G = ProjectorConditions(T_projector_camera_reference);
  const Eigen::Vector2d g = G * x;
  const Eigen::Matrix2d g_covariance = G * covariance * G.transpose();
  motion.projector_chi2 = g.dot(g_covariance.inverse() * g);
  // chi2 with 5 dof by Wilson and Hilferty's cube root.
  const double z =
      (std::cbrt(motion.significance * motion.significance / 5.0) - (1.0 - 2.0 / 45.0)) /
      std::sqrt(2.0 / 45.0);
  const bool large = std::max(motion.turn_deg, motion.direction_deg) >= config.min_turn_deg;
  if (!(z > config.alarm_sigma) || !large) return motion;
  const bool camera_fits = motion.camera_chi2 <= limit2;
  const bool projector_fits = motion.projector_chi2 <= limit2;
  motion.moved = camera_fits && projector_fits ? MovedDevice::kEither
                 : camera_fits                 ? MovedDevice::kCamera
                 : projector_fits              ? MovedDevice::kProjector
                                               : MovedDevice::kBoth;
  return motion;
}

Result<HealthReport> CheckHealth(const PhaseMap& phase, const CellCalibration& calibration,
                                 const EpipolarConfig& epipolar, const HealthConfig& config) {
  if (Status status = CheckBounds(config, "health"); !status) return Forward(status);
  if (Status status = Validate(calibration, "health"); !status) return Forward(status);
  if (phase.width != calibration.camera.width || phase.height != calibration.camera.height) {
    return Fail("health: the phase map is {} x {}, but the calibrated camera is {} x {}",
                phase.width, phase.height, calibration.camera.width, calibration.camera.height);
  }
  const Result<std::vector<Match>> matches = SampleMatches(phase, epipolar.max_matches);
  if (!matches) return Forward(matches);
  const DevicePair devices{calibration.camera, calibration.projector};
  HealthReport report;
  ResidualMaps maps = MapResiduals(phase, devices, calibration.T_projector_camera);
  report.num_pixels = static_cast<int>(std::count_if(
      maps.px.begin(), maps.px.end(), [](float value) { return std::isfinite(value); }));
  report.median_px = MedianOf(maps.px, false);
  report.median_abs_px = MedianOf(maps.px, true);
  report.reduced_chi2 = std::pow(1.4826 * MedianOf(maps.sigmas, true), 2);
  report.systematic_px = Systematic(maps.px, config.block_px);
  report.residual_px = std::move(maps.px);
  const Result<RelativePose> pose =
      EstimateRelativePose(*matches, devices, epipolar, calibration.T_projector_camera);
  if (pose) {
    report.pose = *pose;
    report.motion = CompareWithReference(*pose, calibration.T_projector_camera, config);
    report.refit_systematic_px =
        Systematic(MapResiduals(phase, devices, pose->T_observed_anchor).px, config.block_px);
  } else {
    report.pose_error = pose.error().message;
  }
  Judge(report, config);
  return report;
}

void HealthHistory::Add(std::int64_t stamp_ns, const HealthReport& report,
                        const CellCalibration& calibration) {
  if (!std::isfinite(report.median_px)) return;
  Sample sample{stamp_ns, report.median_px, std::nullopt};
  if (report.pose) {
    sample.turn_rad = LogRotation(calibration.T_projector_camera.linear().transpose() *
                                  report.pose->T_observed_anchor.linear());
  }
  samples_.push_back(sample);
}

Drift HealthHistory::Fit(const HealthConfig& config) const {
  Drift drift;
  drift.num_scans = static_cast<int>(samples_.size());
  std::vector<double> hours;
  std::vector<double> medians;
  std::vector<double> turn_hours;
  std::array<std::vector<double>, 3> turns;
  for (const Sample& sample : samples_) {
    const double hour = static_cast<double>(sample.stamp_ns - samples_.front().stamp_ns) / 3.6e12;
    hours.push_back(hour);
    medians.push_back(sample.median_px);
    if (!sample.turn_rad) continue;
    turn_hours.push_back(hour);
    for (std::size_t k = 0; k < 3; ++k) {
      turns[k].push_back(kDegPerRad * (*sample.turn_rad)[static_cast<Eigen::Index>(k)]);
    }
  }
  if (hours.size() < 3) {
    drift.message = fmt::format("{} scans, a trend needs 3", hours.size());
    return drift;
  }
  drift.span_h =
      *std::max_element(hours.begin(), hours.end()) - *std::min_element(hours.begin(), hours.end());
  const Slope residual = FitSlope(hours, medians);
  drift.rate_px_h = residual.rate;
  drift.sigma_px_h = residual.sigma;
  drift.significant = residual.normal_score > config.alarm_sigma;
  for (std::size_t k = 0; k < 3; ++k) {
    const Slope turn = FitSlope(turn_hours, turns[k]);
    drift.turn_rate_deg_h[static_cast<Eigen::Index>(k)] = turn.rate;
    drift.sigma_turn_deg_h = std::max(drift.sigma_turn_deg_h, turn.sigma);
    drift.significant = drift.significant || turn.normal_score > config.alarm_sigma;
  }
  drift.message = fmt::format(
      "{}: residual {:+.4f} +- {:.4f} px/h, turn {:.4f} +- {:.4f} deg/h over {:.3g} h",
      drift.significant ? "drift" : "no significant drift", drift.rate_px_h, drift.sigma_px_h,
      drift.turn_rate_deg_h.norm(), drift.sigma_turn_deg_h, drift.span_h);
  return drift;
}

}  // namespace fringe_fusion
