#include "fringe_fusion/registration/register_views.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/registration/match_views.hpp"
#include "fringe_fusion/registration/pose_system.hpp"

namespace fringe_fusion {
namespace {

constexpr double kRadPerDeg = M_PI / 180.0;
// A level ends when the joint step is this small in its own standard deviations ...
constexpr std::array<double, ViewSurface::kNumLevels> kStopSigma = {1.0, 0.3, 0.03};
// ... or, for data without noise, moves no point by more than this share of the point spacing.
constexpr double kStopMotion = 1e-5;

std::size_t At(int i) { return static_cast<std::size_t>(i); }

Status CheckInput(const ViewGraph& graph, const RegistrationConfig& config) {
  if (Status status = CheckBounds(config, "registration"); !status) return status;
  if (graph.views.size() < 2) {
    return Fail("registration: {} view(s) given, at least 2 needed", graph.views.size());
  }
  for (const View& view : graph.views) {
    if (Status status = Validate(view); !status) return status;
  }
  return {};
}

std::vector<PoseConstraint> MakeConstraints(const ViewGraph& graph, bool use_prior) {
  const bool any_covariance =
      std::any_of(graph.views.begin(), graph.views.end(),
                  [](const View& view) { return view.pose.covariance.norm() > 0.0; });
  std::vector<PoseConstraint> constraints(graph.views.size());
  bool any_held = false;
  for (std::size_t i = 0; i < graph.views.size(); ++i) {
    const Pose& pose = graph.views[i].pose;
    const bool stated = pose.covariance.norm() > 0.0;
    constraints[i].held = any_covariance && !stated;
    constraints[i].has_prior = use_prior && stated;
    constraints[i].T_object_camera_prior = pose.T_object_camera;
    if (constraints[i].has_prior) constraints[i].information = InformationOf(pose.covariance);
    any_held = any_held || constraints[i].held || constraints[i].has_prior;
  }
  // Without any prior the object frame is where the first view says it is.
  if (!any_held) constraints.front().held = true;
  return constraints;
}

// Largest distance by which the step moves the middle of a view or a point at its radius.
double Motion(const PoseStep& step, const SurfaceSet& set) {
  double motion = 0.0;
  for (std::size_t i = 0; i < step.xi.size(); ++i) {
    const Eigen::Vector3d rotation = step.xi[i].head<3>();
    const Eigen::Vector3d shift = step.xi[i].tail<3>() + rotation.cross(set.surfaces[i].centroid());
    motion = std::max(motion, shift.norm() + rotation.norm() * set.surfaces[i].radius_m());
  }
  return motion;
}

// State of the iteration: the current poses and what the last step knew about them.
class Registration {
 public:
  Registration(const ViewGraph& graph, const RegistrationConfig& config, const SurfaceSet& set)
      : config_(config),
        set_(set),
        constraints_(MakeConstraints(graph, config.use_prior)),
        pairs_(AllPairs(static_cast<int>(graph.views.size()))),
        radius_m_(config.max_distance_m) {
    for (const View& view : graph.views) {
      poses_.push_back(view.pose.T_object_camera);
      covariances_.push_back(view.pose.covariance);
    }
  }

  // Coarse to fine. Each level may use its share of the iterations that are left.
  Status Run(const Progress& progress) {
    for (int level = 0; level < ViewSurface::kNumLevels; ++level) {
      const int levels_left = ViewSurface::kNumLevels - level;
      const int budget = (config_.max_iterations - iterations_) / levels_left;
      converged_ = false;
      for (int i = 0; i < budget && !converged_; ++i) {
        const double done = static_cast<double>(iterations_) / config_.max_iterations;
        if (!progress("register", done)) return Fail("{}", kCancelled);
        if (Status status = Iterate(level); !status) return status;
      }
      DropEmptyPairs();
    }
    return {};
  }

  // Residual over all pairs as found with the first search radius, for a fair before and after.
  [[nodiscard]] double Residual() const {
    MatchLimits limits = Limits(1);
    limits.radius_m = config_.max_distance_m;
    return MatchViews(set_, poses_, AllPairs(static_cast<int>(poses_.size())), limits).rms_m;
  }

  [[nodiscard]] RegistrationResult Finish(const ViewGraph& graph) const;

 private:
  [[nodiscard]] MatchLimits Limits(int level) const {
    MatchLimits limits;
    limits.radius_m = radius_m_;
    limits.max_normal_angle_rad = config_.max_normal_angle_deg * kRadPerDeg;
    limits.rejection_mad = config_.rejection_mad;
    limits.min_overlap_ratio = config_.min_overlap_ratio;
    limits.min_correspondences = config_.min_correspondences;
    limits.level = level;
    return limits;
  }

  // One search of partners and one Gauss-Newton step.
  Status Iterate(int level) {
    matches_ = MatchViews(set_, poses_, pairs_, Limits(level));
    ++iterations_;
    std::vector<PairInformation> information(matches_.pairs.size());
    ParallelFor(static_cast<int>(information.size()), 1, [&](int begin, int end) {
      for (int i = begin; i < end; ++i) {
        information[At(i)].first = matches_.pairs[At(i)].first;
        information[At(i)].second = matches_.pairs[At(i)].second;
        if (matches_.pairs[At(i)].counts) {
          information[At(i)] = SumPair(matches_.pairs[At(i)], set_, poses_);
        }
      }
    });
    const double scale = std::max(ScaleFloor(set_), matches_.scale);
    Result<PoseStep> step = SolvePoses(information, constraints_, poses_, set_, scale * scale);
    if (!step) return tl::unexpected<Error>(step.error());
    double motion = Motion(*step, set_);
    // Partners within the radius say nothing about longer ways.
    const double shorten = motion > radius_m_ ? radius_m_ / motion : 1.0;
    motion *= shorten;
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (constraints_[i].held) continue;
      poses_[i] = poses_[i] * Exp(shorten * step->xi[i]);
    }
    covariances_ = std::move(step->covariance);
    ShrinkRadius(motion);
    for (std::size_t i = 0; i < pairs_.size(); ++i) pairs_[i].counted = matches_.pairs[i].counts;
    converged_ = shorten == 1.0 && (step->size_sigma <= kStopSigma[At(level)] ||
                                    motion <= kStopMotion * set_.max_spacing_m);
    return {};
  }

  void ShrinkRadius(double motion_m) {
    std::vector<double> scales;
    for (const ViewPair& pair : matches_.pairs) {
      if (pair.counts) scales.push_back(pair.scale_m);
    }
    if (scales.empty()) return;
    const auto middle = scales.begin() + static_cast<std::ptrdiff_t>(scales.size() / 2);
    std::nth_element(scales.begin(), middle, scales.end());
    // Nearest points of two grids lie up to about one spacing apart along the surface.
    const double needed = 2.5 * set_.max_spacing_m + 4.0 * *middle + 3.0 * motion_m;
    radius_m_ = std::min(radius_m_, needed);
  }

  void DropEmptyPairs() {
    if (matches_.pairs.empty()) return;  // no iteration yet
    std::vector<PairNumbers> kept;
    for (const ViewPair& pair : matches_.pairs) {
      if (!pair.from_first.empty() || !pair.from_second.empty()) {
        kept.push_back({pair.first, pair.second, pair.counts});
      }
    }
    pairs_ = std::move(kept);
  }

  RegistrationConfig config_;
  const SurfaceSet& set_;
  std::vector<PoseConstraint> constraints_;
  std::vector<PairNumbers> pairs_;
  double radius_m_;
  std::vector<Transform> poses_;
  std::vector<Matrix6d> covariances_;
  MatchSet matches_;
  int iterations_ = 0;
  bool converged_ = false;
};

// Adds the accepted residuals of a view's samples to its sums.
struct ViewSums {
  double squares = 0.0;
  int residuals = 0;
  std::vector<bool> partnered;
};

RegistrationResult Registration::Finish(const ViewGraph& graph) const {
  std::vector<ViewSums> sums(graph.views.size());
  for (std::size_t i = 0; i < sums.size(); ++i) {
    sums[i].partnered.assign(set_.surfaces[i].points().size(), false);
  }
  const auto add = [&](int view, const std::vector<Match>& matches) {
    for (const Match& match : matches) {
      const double residual = match.residual_m;
      sums[At(view)].squares += residual * residual;
      ++sums[At(view)].residuals;
      sums[At(view)].partnered[At(match.source)] = true;
    }
  };
  std::vector<bool> connected(sums.size(), false);
  for (const ViewPair& pair : matches_.pairs) {
    if (!pair.counts) continue;
    connected[At(pair.first)] = true;
    connected[At(pair.second)] = true;
    add(pair.first, pair.from_first);
    add(pair.second, pair.from_second);
  }
  RegistrationResult out;
  out.iterations = iterations_;
  out.converged = converged_;
  for (std::size_t i = 0; i < sums.size(); ++i) {
    RegisteredView view;
    view.id = graph.views[i].id;
    view.pose = graph.views[i].pose;
    view.connected = connected[i];
    if (view.connected) {
      const auto samples =
          static_cast<double>(set_.surfaces[i].samples(ViewSurface::kNumLevels - 1).size());
      const auto partnered = std::count(sums[i].partnered.begin(), sums[i].partnered.end(), true);
      view.overlap_ratio = static_cast<double>(partnered) / samples;
      view.rms_m = std::sqrt(sums[i].squares / std::max(1, sums[i].residuals));
      if (constraints_[i].held) {
        view.pose.covariance.setZero();  // the others are stated relative to it
      } else {
        view.pose.T_object_camera = poses_[i];
        view.pose.covariance = covariances_[i];
        view.pose.source = PoseSource::kRegistration;
      }
    }
    out.views.push_back(view);
  }
  return out;
}

}  // namespace

Result<RegistrationResult> RegisterViews(const ViewGraph& graph, const RegistrationConfig& config,
                                         const Progress& progress) {
  if (Status status = CheckInput(graph, config); !status) {
    return tl::unexpected<Error>(status.error());
  }
  const Result<SurfaceSet> set =
      MakeSurfaces(graph.views, PixelSet::kRegistration, config.max_points_per_view);
  if (!set) return Forward(set);
  Registration registration(graph, config, *set);
  const double rms_before_m = registration.Residual();
  if (Status status = registration.Run(progress); !status) {
    return tl::unexpected<Error>(status.error());
  }
  RegistrationResult out = registration.Finish(graph);
  out.rms_before_m = rms_before_m;
  out.rms_after_m = registration.Residual();
  static_cast<void>(progress("register", 1.0));
  return out;
}

}  // namespace fringe_fusion
