#include "fringe_fusion/pose/self_calibration.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "common/dense.hpp"
#include "epipolar_solver.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "fundamental.hpp"
#include "pose_start.hpp"

namespace fringe_fusion {
namespace {

using epipolar::Geometry;
using epipolar::Ray;
using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;

constexpr int kMatchesPerPart = 2048;
constexpr double kMaxLogFocal = 1.0986122886681098;  // a factor of three

/// Seven parameters: pose and the logarithms of both focal lengths against the nominal ones.
struct State {
  Geometry geometry;
  Eigen::Vector2d log_focal = Eigen::Vector2d::Zero();  ///< anchor, observed
};

struct Sums {
  Matrix7d hessian = Matrix7d::Zero();
  Matrix7d information = Matrix7d::Zero();  ///< of the inliers, without priors
  Vector7d gradient = Vector7d::Zero();
  double cost = 0.0;
  double chi2 = 0.0;
  int num_inliers = 0;

  void Add(double e, const Vector7d& jacobian, double huber_sigma);
  void Add(const Sums& other);
};

/// The model with its focal lengths multiplied and the same distortion in pixels: what is known of
/// a lens before its focal length is a map of pixels, and it must not tell the focal length.
CameraModel WithFocal(CameraModel model, double factor) {
  model.fx *= factor;
  model.fy *= factor;
  const double squared = factor * factor;
  model.distortion[0] *= squared;
  model.distortion[1] *= squared * squared;
  model.distortion[2] *= factor;
  model.distortion[3] *= factor;
  model.distortion[4] *= squared * squared * squared;
  return model;
}

/// The seven-parameter least squares of one pair.
class PairProblem {
 public:
  PairProblem(const std::vector<Match>& matches, const DevicePair& nominal,
              const std::array<IntrinsicsPrior, 2>& priors, double huber_sigma)
      : matches_(matches), nominal_(nominal), priors_(priors), huber_sigma_(huber_sigma) {}

  [[nodiscard]] DevicePair DevicesAt(const Eigen::Vector2d& log_focal) const {
    return {WithFocal(nominal_.anchor, std::exp(log_focal[0])),
            WithFocal(nominal_.observed, std::exp(log_focal[1]))};
  }

  [[nodiscard]] Sums SumUp(const State& state, double scale) const;
  /// Levenberg-Marquardt; the robust scale follows in three rounds.
  [[nodiscard]] bool Solve(State& state, double& scale) const;
  [[nodiscard]] bool IsHeld(int device) const {
    return priors_[static_cast<std::size_t>(device)].focal_ratio == 0.0;
  }

 private:
  [[nodiscard]] bool Descend(State& state, double scale) const;
  void AddPriors(const State& state, Sums& sums) const;

  const std::vector<Match>& matches_;
  const DevicePair& nominal_;
  std::array<IntrinsicsPrior, 2> priors_;
  double huber_sigma_;
};

void Sums::Add(double e, const Vector7d& jacobian, double huber_sigma) {
  const double magnitude = std::abs(e);
  const bool inlier = magnitude <= huber_sigma;
  const double weight = inlier ? 1.0 : huber_sigma / magnitude;
  cost += inlier ? e * e : 2.0 * huber_sigma * magnitude - huber_sigma * huber_sigma;
  chi2 += weight * e * weight * e;
  const Matrix7d outer = jacobian * jacobian.transpose();
  hessian += weight * outer;
  gradient += weight * e * jacobian;
  if (!inlier) return;
  information += outer;
  ++num_inliers;
}

void Sums::Add(const Sums& other) {
  hessian += other.hessian;
  information += other.information;
  gradient += other.gradient;
  cost += other.cost;
  chi2 += other.chi2;
  num_inliers += other.num_inliers;
}

Sums PairProblem::SumUp(const State& state, double scale) const {
  const DevicePair devices = DevicesAt(state.log_focal);
  const std::vector<Ray> rays = epipolar::MakeRays(matches_, devices);
  Sums sums;
  if (rays.size() != matches_.size()) {
    sums.cost = kFree;  // a lens model that cannot be inverted at this focal length
    return sums;
  }
  const int count = static_cast<int>(rays.size());
  const epipolar::Linearizer linearize(state.geometry);
  std::vector<Sums> parts(
      static_cast<std::size_t>((count + kMatchesPerPart - 1) / kMatchesPerPart));
  ParallelFor(count, kMatchesPerPart, [&](int begin, int end) {
    Sums& part = parts[static_cast<std::size_t>(begin / kMatchesPerPart)];
    for (int i = begin; i < end; ++i) {
      const Ray& ray = rays[static_cast<std::size_t>(i)];
      const epipolar::Linearization at = linearize(ray);
      Vector7d jacobian = Vector7d::Zero();
      jacobian.head<5>() = at.pose;
      if (!IsHeld(0)) {
        jacobian[5] = -at.anchor.dot(ray.anchor);
      }
      if (!IsHeld(1)) {
        // e = N / D with D ~ 1 / f: the first term.
        jacobian[6] = at.e - at.observed.dot(ray.observed);
      }
      part.Add(at.e / scale, jacobian / scale, huber_sigma_);
    }
  });
  for (const Sums& part : parts) sums.Add(part);
  AddPriors(state, sums);
  return sums;
}

void PairProblem::AddPriors(const State& state, Sums& sums) const {
  for (int device = 0; device < 2; ++device) {
    const double sigma = priors_[static_cast<std::size_t>(device)].focal_ratio;
    const int k = 5 + device;
    if (IsHeld(device)) {
      sums.hessian(k, k) += 1.0;  // the parameter has no residual: keep it where it is
    } else if (std::isfinite(sigma)) {
      sums.hessian(k, k) += 1.0 / (sigma * sigma);
      sums.gradient[k] += state.log_focal[device] / (sigma * sigma);
      sums.cost += std::pow(state.log_focal[device] / sigma, 2);
    }
  }
}

bool PairProblem::Descend(State& state, double scale) const {
  constexpr int kMaxIterations = 40;
  double damping = 1e-4;
  Sums sums = SumUp(state, scale);
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    Matrix7d damped = sums.hessian;
    damped.diagonal() *= 1.0 + damping;
    const Vector7d step = -dense::SolveSymmetric(damped, sums.gradient);
    if (!step.allFinite()) return false;
    State moved;
    moved.geometry = epipolar::Perturb(state.geometry, step.head<5>());
    moved.log_focal = state.log_focal + step.tail<2>();
    const bool inside = moved.log_focal.cwiseAbs().maxCoeff() < 1.5 * kMaxLogFocal;
    const Sums next = inside ? SumUp(moved, scale) : sums;
    if (inside && next.cost <= sums.cost) {
      const double size = std::sqrt(std::max(0.0, step.dot(sums.hessian * step)));
      state = moved;
      sums = next;
      damping = std::max(1e-12, 0.1 * damping);
      if (size < 1e-4) return true;
    } else {
      damping *= 10.0;
      if (damping > 1e10) return true;
    }
  }
  return false;
}

bool PairProblem::Solve(State& state, double& scale) const {
  bool converged = false;
  for (int round = 0; round < 3; ++round) {
    scale = epipolar::RobustScale(epipolar::MakeRays(matches_, DevicesAt(state.log_focal)),
                                  state.geometry.Essential());
    converged = Descend(state, scale);
  }
  return converged;
}

/// Condition number of the free parameters, scaled to unit diagonal.
double FreeCondition(const Matrix7d& information, const std::vector<int>& free) {
  const auto n = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd scaled(n, n);
  for (Eigen::Index r = 0; r < n; ++r) {
    for (Eigen::Index c = 0; c < n; ++c) {
      const int i = free[static_cast<std::size_t>(r)];
      const int j = free[static_cast<std::size_t>(c)];
      scaled(r, c) = information(i, j) / std::sqrt(information(i, i) * information(j, j));
    }
  }
  if (!scaled.allFinite()) return kFree;
  const Eigen::VectorXd values = dense::SymmetricEigenvalues(scaled);
  return values[0] > 0.0 ? values[n - 1] / values[0] : kFree;
}

Status CheckPriors(const IntrinsicsPrior& prior, const char* name) {
  if (!(prior.focal_ratio >= 0.0) || !(prior.principal_px >= 0.0) || !(prior.k1 >= 0.0)) {
    return Fail(
        "self-calibration: a prior sigma of the {} device is negative: focal {}, principal "
        "point {}, k1 {}",
        name, prior.focal_ratio, prior.principal_px, prior.k1);
  }
  if (prior.principal_px > 0.0 || prior.k1 > 0.0) {
    return Fail(
        "self-calibration: one pair determines two numbers beside the pose; the principal "
        "point or distortion of the {} device (sigma {} px, {}) needs more stations: turn "
        "the camera by 90 deg and use at least 4",
        name, prior.principal_px, prior.k1);
  }
  return {};
}

/// Why a layout leaves the focal lengths open, and what helps.
std::string Reason(const PairCalibration& result) {
  constexpr double kCoplanarDeg = 1.0;
  if (result.pose.planar) {
    return "the scene is flat: measure an object with relief, or give one focal length";
  }
  if (result.axes_out_of_plane_deg < kCoplanarDeg) {
    return fmt::format(
        "the optical axes and the baseline are coplanar to {:.2f} deg: pitch the "
        "projector by some degrees, use lens shift with a known principal point, "
        "give one focal length, or add stations",
        result.axes_out_of_plane_deg);
  }
  return "the relief or the field is too small for the noise: use more relief or add stations";
}

/// Starts for the seven parameters: nominal values, and Bougnoux's where they exist.
struct Starts {
  State nominal;
  double nominal_scale = 1.0;
  std::optional<State> linear;
  bool planar = false;
};

Result<Starts> MakeStarts(const std::vector<Match>& matches, const DevicePair& nominal,
                          const PairProblem& problem, const EpipolarConfig& config) {
  EpipolarConfig loose = config;
  // Wrong focal lengths leave residuals that are no reason to refuse.
  loose.max_residual_px = 1000.0;
  loose.min_inlier_ratio = 0.0;
  loose.max_direction_sigma_deg = 90.0;
  loose.min_ambiguity_chi2 = 0.0;
  const auto pose = EstimateRelativePose(matches, nominal, loose);
  if (!pose) return Forward(pose);
  Starts starts;
  starts.nominal.geometry = {pose->T_observed_anchor.linear(),
                             pose->T_observed_anchor.translation()};
  starts.planar = pose->planar;
  starts.nominal_scale = epipolar::RobustScale(epipolar::MakeRays(matches, nominal),
                                               starts.nominal.geometry.Essential());
  if (problem.IsHeld(0) || problem.IsHeld(1)) return starts;
  const std::vector<Ray> rays = epipolar::MakeRays(matches, nominal);
  const Eigen::Matrix3d F = epipolar::EightPoint(rays, starts.nominal.geometry.Essential());
  // Normalised by the nominal focal lengths, with the principal points at 0.
  const auto focal = FocalLengthsOf(F, Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero());
  if (!focal || !(focal->array().log().abs().maxCoeff() < kMaxLogFocal)) return starts;
  State linear;
  linear.log_focal = focal->array().log();
  const Eigen::Vector3d a(1.0 / (*focal)[0], 1.0 / (*focal)[0], 1.0);
  const Eigen::Vector3d o(1.0 / (*focal)[1], 1.0 / (*focal)[1], 1.0);
  const Eigen::Matrix3d essential =
      o.cwiseInverse().asDiagonal() * F * a.cwiseInverse().asDiagonal();
  linear.geometry = epipolar::DecomposeEssential(
      essential, epipolar::MakeRays(matches, problem.DevicesAt(linear.log_focal)));
  starts.linear = linear;
  return starts;
}

struct Solution {
  State state;
  double scale = 1.0;
  bool converged = false;
  bool linear_start = false;
};

/// The better of the descents from both starts.
Solution BestOf(const PairProblem& problem, const Starts& starts) {
  Solution best;
  best.state = starts.nominal;
  best.converged = problem.Solve(best.state, best.scale);
  if (!starts.linear) return best;
  Solution other;
  other.state = *starts.linear;
  other.linear_start = true;
  other.converged = problem.Solve(other.state, other.scale);
  const double unit = std::max(best.scale, other.scale);
  const bool better = problem.SumUp(other.state, unit).cost < problem.SumUp(best.state, unit).cost;
  return other.converged && (better || !best.converged) ? other : best;
}

/// Covariance of the seven parameters; held ones have none.
Matrix7d CovarianceOf(const Sums& sums, const std::vector<int>& free) {
  const auto n = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd information(n, n);
  for (Eigen::Index r = 0; r < n; ++r) {
    for (Eigen::Index c = 0; c < n; ++c) {
      information(r, c) =
          sums.hessian(free[static_cast<std::size_t>(r)], free[static_cast<std::size_t>(c)]);
    }
  }
  const Eigen::MatrixXd inverse = dense::Invert(information);
  const double reduced =
      std::max(1.0, sums.chi2 / std::max(1, sums.num_inliers - static_cast<int>(n)));
  Matrix7d covariance = Matrix7d::Zero();
  for (Eigen::Index r = 0; r < n; ++r) {
    for (Eigen::Index c = 0; c < n; ++c) {
      covariance(free[static_cast<std::size_t>(r)], free[static_cast<std::size_t>(c)]) =
          reduced * inverse(r, c);
    }
  }
  return covariance;
}

/// Refuses focal lengths that the layout does not determine.
Status JudgeFocal(const PairCalibration& result, const EpipolarConfig& config) {
  const double sigma = std::max(result.sigma_focal_anchor_ratio, result.sigma_focal_observed_ratio);
  // Negated so that NaN fails.
  if (!(result.condition <= config.max_condition) || !(sigma <= config.max_focal_sigma_ratio)) {
    return Fail(
        "self-calibration: the focal lengths are not determined (sigma {:.2g} %, limit "
        "{:.2g} %; condition {:.2g}, limit {:.2g}): {}",
        100.0 * sigma, 100.0 * config.max_focal_sigma_ratio, result.condition, config.max_condition,
        Reason(result));
  }
  return {};
}

/// Figures of a solution without judgement.
PairCalibration Describe(const PairProblem& problem, const State& state, double scale,
                         const std::vector<int>& free) {
  const Sums sums = problem.SumUp(state, scale);
  PairCalibration result;
  result.devices = problem.DevicesAt(state.log_focal);
  result.covariance = CovarianceOf(sums, free);
  result.condition = FreeCondition(sums.information, free);
  result.sigma_focal_anchor_ratio = std::sqrt(result.covariance(5, 5));
  result.sigma_focal_observed_ratio = std::sqrt(result.covariance(6, 6));
  result.pose.T_observed_anchor.linear() = state.geometry.R;
  result.pose.T_observed_anchor.translation() = state.geometry.t;
  result.axes_out_of_plane_deg = AxesOutOfPlaneDeg(result.pose.T_observed_anchor);
  return result;
}

}  // namespace

Result<PairCalibration> SelfCalibratePair(const std::vector<Match>& matches,
                                          const DevicePair& nominal, const IntrinsicsPrior& anchor,
                                          const IntrinsicsPrior& observed,
                                          const EpipolarConfig& config) {
  if (Status status = CheckPriors(anchor, "anchor"); !status) return Forward(status);
  if (Status status = CheckPriors(observed, "observed"); !status) return Forward(status);
  const PairProblem problem(matches, nominal, {anchor, observed}, config.huber_sigma);
  std::vector<int> free{0, 1, 2, 3, 4};
  if (!problem.IsHeld(0)) free.push_back(5);
  if (!problem.IsHeld(1)) free.push_back(6);
  if (free.size() == 5) return Fail("self-calibration: both focal lengths are held (sigma 0)");
  const Result<Starts> starts = MakeStarts(matches, nominal, problem, config);
  if (!starts) return Forward(starts);
  // A singular layout shows at the nominal values; a solution that ran away would hide it.
  PairCalibration before = Describe(problem, starts->nominal, starts->nominal_scale, free);
  before.pose.planar = starts->planar;
  if (Status status = JudgeFocal(before, config); !status) return Forward(status);

  const Solution solution = BestOf(problem, *starts);
  PairCalibration result = Describe(problem, solution.state, solution.scale, free);
  result.linear_start = solution.linear_start;
  result.pose.planar = starts->planar;
  if (!solution.converged || !(solution.state.log_focal.cwiseAbs().maxCoeff() < kMaxLogFocal)) {
    return Fail(
        "self-calibration: the focal lengths ran to {:.3g} and {:.3g} times the nominal "
        "ones, limit 3: {}",
        std::exp(solution.state.log_focal[0]), std::exp(solution.state.log_focal[1]),
        Reason(before));
  }
  if (Status status = JudgeFocal(result, config); !status) return Forward(status);
  // The pose with all its figures and checks, by the calibrated devices.
  auto pose = EstimateRelativePose(matches, result.devices, config, result.pose.T_observed_anchor);
  if (!pose) return Forward(pose);
  pose->T_observed_anchor = result.pose.T_observed_anchor;
  pose->covariance = result.covariance.topLeftCorner<5, 5>();
  result.pose = *pose;
  return result;
}

}  // namespace fringe_fusion
