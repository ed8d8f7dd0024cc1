#include "fringe_fusion/pose/relative_pose.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/constants.hpp"
#include "common/dense.hpp"
#include "epipolar_solver.hpp"
#include "pose_start.hpp"

namespace fringe_fusion {
namespace {

using epipolar::Geometry;
using epipolar::Ray;
using epipolar::Refined;
using epipolar::RefineOptions;

constexpr double kInlierSigma = 3.0;
constexpr std::size_t kStartRays = 800;

RefineOptions OptionsOf(const EpipolarConfig& config, const DevicePair& devices) {
  RefineOptions options;
  options.huber_sigma = config.huber_sigma;
  options.symmetric = config.objective == "symmetric";
  options.focal_anchor_px = std::sqrt(devices.anchor.fx * devices.anchor.fy);
  options.focal_observed_px = std::sqrt(devices.observed.fx * devices.observed.fy);
  return options;
}

Geometry FromTransform(const Transform& T) { return {T.linear(), T.translation().normalized()}; }

/// Refined candidates on a sample, best first, without those that lie behind a device.
std::vector<Refined> RefineStarts(const std::vector<Ray>& rays, const std::vector<Geometry>& starts,
                                  const RefineOptions& options, double min_cheirality) {
  constexpr std::size_t kQuickRays = 250;
  constexpr std::size_t kMaxCandidates = 3;
  RefineOptions quick = options;
  quick.symmetric = false;  // costs in deviations are comparable
  quick.max_iterations = 8;
  const std::vector<Ray> few = epipolar::Thin(rays, kQuickRays);
  std::vector<Refined> candidates;
  const auto add = [&](const Refined& refined, std::vector<Refined>& to) {
    if (!std::isfinite(refined.cost)) return;
    if (!(epipolar::CheiralityRatio(rays, refined.geometry) >= min_cheirality)) return;
    const bool known = std::any_of(to.begin(), to.end(), [&](const Refined& other) {
      return epipolar::IsSame(refined.geometry, other.geometry);
    });
    if (!known) to.push_back(refined);
  };
  const auto by_cost = [](const Refined& a, const Refined& b) {
    return a.cost * a.scale * a.scale < b.cost * b.scale * b.scale;
  };
  for (const Geometry& start : starts) add(epipolar::Refine(few, start, quick), candidates);
  std::stable_sort(candidates.begin(), candidates.end(), by_cost);
  if (candidates.size() > kMaxCandidates) candidates.resize(kMaxCandidates);
  quick.max_iterations = options.max_iterations;
  std::vector<Refined> out;
  for (const Refined& one : candidates) add(epipolar::Refine(rays, one.geometry, quick), out);
  std::stable_sort(out.begin(), out.end(), by_cost);
  return out;
}

double DistanceToPrior(const Geometry& geometry, const Geometry& prior) {
  return LogRotation(prior.R.transpose() * geometry.R).norm() +
         std::atan2(geometry.t.cross(prior.t).norm(), geometry.t.dot(prior.t));
}

/// The winner of two poses, and by how much the other one fits worse.
struct Choice {
  Geometry geometry;
  double ambiguity_chi2 = std::numeric_limits<double>::infinity();
};

Result<Choice> Choose(const std::vector<Ray>& rays, const std::vector<Refined>& candidates,
                      const RefineOptions& options, const EpipolarConfig& config,
                      const std::optional<Geometry>& prior) {
  Choice choice{candidates.front().geometry};
  if (candidates.size() < 2) return choice;
  // A sample that decides clearly is not outvoted by all matches.
  const double sample_unit = std::pow(candidates[0].scale, 2);
  const double sample_chi2 =
      candidates[1].cost * std::pow(candidates[1].scale, 2) / sample_unit - candidates[0].cost;
  if (sample_chi2 >= 2.0 * config.min_ambiguity_chi2) {
    choice.ambiguity_chi2 = sample_chi2;
    return choice;
  }
  RefineOptions one_sided = options;
  one_sided.symmetric = false;
  // Both on all matches and in units of the better one's scale.
  const Refined best = epipolar::Refine(rays, candidates[0].geometry, one_sided);
  const Refined other = epipolar::Refine(rays, candidates[1].geometry, one_sided);
  choice.geometry = best.geometry;
  if (epipolar::IsSame(best.geometry, other.geometry)) return choice;
  const double unit = best.scale * best.scale;
  choice.ambiguity_chi2 = other.cost * other.scale * other.scale / unit - best.cost;
  if (std::abs(choice.ambiguity_chi2) >= config.min_ambiguity_chi2) {
    if (choice.ambiguity_chi2 < 0.0) choice.geometry = other.geometry;
    return choice;
  }
  if (!prior) {
    return Fail(
        "pose: the scene is too flat: two poses {:.1f} deg apart fit equally well (chi2 "
        "differs by {:.1f}, limit {:.1f}); give a rough pose, a second view, or relief",
        kDegPerRad * LogRotation(best.geometry.R.transpose() * other.geometry.R).norm(),
        std::abs(choice.ambiguity_chi2), config.min_ambiguity_chi2);
  }
  if (DistanceToPrior(other.geometry, *prior) < DistanceToPrior(best.geometry, *prior)) {
    choice.geometry = other.geometry;
  }
  return choice;
}

/// Condition number of a symmetric matrix scaled to unit diagonal.
double ScaledCondition(const Matrix5d& matrix) {
  const epipolar::Vector5d scale = matrix.diagonal().cwiseSqrt().cwiseInverse();
  const Matrix5d scaled = scale.asDiagonal() * matrix * scale.asDiagonal();
  if (!scaled.allFinite()) return std::numeric_limits<double>::infinity();
  const epipolar::Vector5d values = dense::SymmetricEigenvalues(scaled);
  return values[0] > 0.0 ? values[4] / values[0] : std::numeric_limits<double>::infinity();
}

Matrix5d CovarianceOf(const Refined& refined, bool symmetric) {
  const Matrix5d inverse = dense::Invert(refined.information);
  // The unweighted objective is no likelihood: its covariance needs the residuals themselves.
  if (symmetric) return inverse * refined.scatter * inverse;
  const double reduced = refined.chi2 / std::max(1, refined.num_inliers - 5);
  return inverse * std::max(1.0, reduced);
}

/// Residual figures over all matches.
void AddResiduals(const std::vector<Ray>& rays, const Geometry& geometry, RelativePose& pose) {
  const Eigen::Matrix3d essential = geometry.Essential();
  const double limit = kInlierSigma * epipolar::RobustScale(rays, essential);
  std::vector<double> distances;
  distances.reserve(rays.size());
  double sum_px2 = 0.0;
  double sum_chi2 = 0.0;
  for (const Ray& ray : rays) {
    const EpipolarResidual r = epipolar::PixelResidual(ray, essential);
    distances.push_back(std::abs(r.distance_px));
    const double e = r.distance_px / r.sigma;
    if (!(std::abs(e) <= limit)) continue;
    ++pose.num_inliers;
    sum_px2 += r.distance_px * r.distance_px;
    sum_chi2 += e * e;
  }
  pose.num_matches = static_cast<int>(rays.size());
  pose.median_residual_px = epipolar::MedianInPlace(distances);
  pose.rms_residual_px = std::sqrt(sum_px2 / std::max(1, pose.num_inliers));
  pose.reduced_chi2 = sum_chi2 / std::max(1, pose.num_inliers - 5);
}

Status JudgeGeometry(const RelativePose& pose, const EpipolarConfig& config) {
  if (!(pose.cheirality_ratio >= config.min_cheirality_ratio)) {
    return Fail("pose: {:.0f} % of the points lie before both devices, limit {:.0f} %",
                100.0 * pose.cheirality_ratio, 100.0 * config.min_cheirality_ratio);
  }
  const double direction_deg =
      kDegPerRad * std::sqrt(std::max(pose.covariance(3, 3), pose.covariance(4, 4)));
  // NaN and infinity fail here as well.
  if (pose.condition <= config.max_condition && direction_deg <= config.max_direction_sigma_deg) {
    return {};
  }
  return Fail(
      "pose: the direction of the baseline is not determined: sigma {:.3g} deg, limit "
      "{:.3g}; condition {:.3g}, limit {:.3g}: the devices stand too close together or the "
      "matches cover too little",
      direction_deg, config.max_direction_sigma_deg, pose.condition, config.max_condition);
}

Status Judge(const RelativePose& pose, const EpipolarConfig& config) {
  const double ratio = static_cast<double>(pose.num_inliers) / std::max(1, pose.num_matches);
  if (!(ratio >= config.min_inlier_ratio)) {
    return Fail("pose: only {:.0f} % of {} matches fit one pose, limit {:.0f} %", 100.0 * ratio,
                pose.num_matches, 100.0 * config.min_inlier_ratio);
  }
  if (!(pose.median_residual_px <= config.max_residual_px)) {
    return Fail(
        "pose: median distance to the epipolar line {:.3g} px, limit {:.3g}: the codes or "
        "the lens models do not belong to these devices",
        pose.median_residual_px, config.max_residual_px);
  }
  return JudgeGeometry(pose, config);
}

Status CheckInput(const std::vector<Match>& matches, const DevicePair& devices,
                  const EpipolarConfig& config) {
  if (Status status = Validate(config); !status) return status;
  if (Status status = Validate(devices.anchor, "pose: anchor"); !status) return status;
  if (Status status = Validate(devices.observed, "pose: observed"); !status) return status;
  return CheckMatches(matches, devices, config);
}

RelativePose PoseOf(const Refined& refined, bool symmetric) {
  RelativePose pose;
  pose.T_observed_anchor.linear() = refined.geometry.R;
  pose.T_observed_anchor.translation() = refined.geometry.t;
  pose.covariance = CovarianceOf(refined, symmetric);
  pose.condition = ScaledCondition(refined.information);
  return pose;
}

}  // namespace

Matrix32d TangentBasis(const Eigen::Vector3d& unit) {
  // Householder reflection that takes the third axis to +-unit, the sign that does not cancel.
  Eigen::Vector3d v = unit;
  v.z() += unit.z() >= 0.0 ? 1.0 : -1.0;
  const Eigen::Matrix3d reflection =
      Eigen::Matrix3d::Identity() - 2.0 / v.squaredNorm() * v * v.transpose();
  return reflection.leftCols<2>();
}

EpipolarResidual ResidualOf(const Match& match, const DevicePair& devices,
                            const Transform& T_observed_anchor) {
  return epipolar::PixelResidual(epipolar::MakeRay(match, devices),
                                 FromTransform(T_observed_anchor).Essential());
}

Result<RelativePose> EstimateRelativePose(const std::vector<Match>& matches,
                                          const DevicePair& devices, const EpipolarConfig& config,
                                          const std::optional<Transform>& T_observed_anchor_prior) {
  if (Status status = CheckInput(matches, devices, config); !status) return Forward(status);
  const std::vector<Ray> rays = epipolar::MakeRays(matches, devices);
  if (rays.size() < static_cast<std::size_t>(config.min_matches)) {
    return Fail("pose: {} of {} matches have rays in both devices, at least {} are needed",
                rays.size(), matches.size(), config.min_matches);
  }
  std::optional<Geometry> prior;
  if (T_observed_anchor_prior && T_observed_anchor_prior->translation().norm() > 0.0) {
    prior = FromTransform(*T_observed_anchor_prior);
  }
  const RefineOptions options = OptionsOf(config, devices);
  const std::vector<Ray> sample = epipolar::Thin(rays, kStartRays);
  constexpr double kMinParallaxSigma = 3.0;
  const double parallax = epipolar::RotationOnlyResidual(sample);
  if (!(parallax > kMinParallaxSigma)) {
    return Fail(
        "pose: a pure rotation explains the matches to {:.2g} deviations, limit {:.2g}: "
        "there is no baseline between the devices",
        parallax, kMinParallaxSigma);
  }
  const epipolar::PlaneFit plane = epipolar::FitPlane(sample);
  const std::vector<Refined> candidates = RefineStarts(
      sample, epipolar::MakeStarts(sample, plane, prior), options, config.min_cheirality_ratio);
  if (candidates.empty()) {
    return Fail(
        "pose: no pose puts {:.0f} % of {} points before both devices (no baseline, or the "
        "codes do not belong to these devices)",
        100.0 * config.min_cheirality_ratio, rays.size());
  }
  const Result<Choice> choice = Choose(rays, candidates, options, config, prior);
  if (!choice) return Forward(choice);
  RefineOptions last = options;
  last.huber_rounds = 1;  // the start is good
  const Refined refined = epipolar::Refine(rays, choice->geometry, last);
  RelativePose pose = PoseOf(refined, options.symmetric);
  pose.cheirality_ratio = epipolar::CheiralityRatio(rays, refined.geometry);
  pose.ambiguity_chi2 = choice->ambiguity_chi2;
  pose.planar = plane.valid && epipolar::PrefersPlane(sample, plane.H, refined.geometry.Essential(),
                                                      candidates.front().scale);
  AddResiduals(rays, refined.geometry, pose);
  if (Status status = Judge(pose, config); !status) return Forward(status);
  return pose;
}

Result<MetricPose> LiftToMetric(const RelativePose& pose, double baseline_m,
                                double sigma_baseline_m) {
  if (!(baseline_m > 0.0) || !std::isfinite(baseline_m)) {
    return Fail("pose: baseline {} m must be positive", baseline_m);
  }
  if (!(sigma_baseline_m >= 0.0) || !std::isfinite(sigma_baseline_m)) {
    return Fail("pose: sigma {} m of the baseline must not be negative", sigma_baseline_m);
  }
  const Eigen::Vector3d t = pose.T_observed_anchor.translation();
  const Eigen::Matrix3d R = pose.T_observed_anchor.linear();
  // T Exp(xi) moves the translation by R rho: rho = R^T (b B d + t db).
  Eigen::Matrix<double, 6, 5> lift = Eigen::Matrix<double, 6, 5>::Zero();
  lift.topLeftCorner<3, 3>().setIdentity();
  lift.bottomRightCorner<3, 2>() = baseline_m * R.transpose() * TangentBasis(t);
  Vector6d along = Vector6d::Zero();
  along.tail<3>() = R.transpose() * t;
  MetricPose out;
  out.T_observed_anchor = pose.T_observed_anchor;
  out.T_observed_anchor.translation() = baseline_m * t;
  out.covariance = lift * pose.covariance * lift.transpose() +
                   sigma_baseline_m * sigma_baseline_m * along * along.transpose();
  return out;
}

}  // namespace fringe_fusion
