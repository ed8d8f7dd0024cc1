#include "registration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "at.hpp"
#include "common/constants.hpp"
#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::internal {
namespace {

// A level ends when the joint step is this small in its own standard deviations ...
constexpr std::array<double, ViewSurface::kNumLevels> kStopSigma = {1.0, 0.3, 0.03};
// ... or, for data without noise, moves no point by more than this share of the point spacing.
constexpr double kStopMotion = 1e-5;

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

PoseConstraint PriorOf(const Mounting& mounting) {
  PoseConstraint prior;
  prior.has_prior = mounting.known;
  prior.T_object_camera_prior = mounting.T;
  if (mounting.known) prior.information = InformationOf(mounting.covariance);
  return prior;
}

}  // namespace

PoseTerms MakeTerms(const ViewGraph& graph, bool use_prior) {
  PoseTerms terms;
  terms.constraints = MakeConstraints(graph, use_prior);
  std::map<int, int> number_of;
  for (std::size_t i = 0; i < graph.views.size(); ++i) {
    number_of[graph.views[i].id] = static_cast<int>(i);
  }
  for (const ViewTie& tie : graph.ties) {
    terms.ties.push_back({number_of.at(tie.first), number_of.at(tie.second), tie.T_first_second,
                          InformationOf(tie.covariance)});
  }
  if (!graph.chain) return terms;
  ChainTerm chain;
  for (const DeviceChain::Reading& reading : graph.chain->readings) {
    chain.views.push_back(number_of.at(reading.view));
    chain.motions.push_back(reading.T_base_flange);
  }
  chain.information = InformationOf(graph.chain->covariance);
  chain.object_base = PriorOf(graph.chain->object_base);
  chain.flange_camera = PriorOf(graph.chain->flange_camera);
  terms.chain = std::move(chain);
  return terms;
}

PoseState StateOf(const ViewGraph& graph, const PoseTerms& terms) {
  PoseState state;
  for (const View& view : graph.views) state.poses.push_back(view.pose.T_object_camera);
  if (terms.chain) StartChain(*terms.chain, state);
  return state;
}

Registration::Registration(const SurfaceSet& set, const RegistrationConfig& config, PoseTerms terms,
                           PoseState state, std::vector<PairNumbers> pairs)
    : set_(set),
      config_(config),
      terms_(std::move(terms)),
      state_(std::move(state)),
      all_pairs_(std::move(pairs)),
      pairs_(all_pairs_),
      radius_m_(config.max_distance_m) {}

Status Registration::Run(const Progress& progress, int first_level) {
  settling_ = false;
  for (int level = first_level; level < ViewSurface::kNumLevels; ++level) {
    if (level > 0) RefreshPairs();
    const int levels_left = ViewSurface::kNumLevels - level + 1;  // one share to settle
    const int budget = (config_.max_iterations - iterations_) / levels_left;
    if (Status status = RunLevel(level, budget, progress); !status) return status;
  }
  return Settle(progress);
}

// The search radius and the pairs remember the way to the solution. At last both follow from the
// poses alone, so that the same views end at the same poses wherever they started.
Status Registration::Settle(const Progress& progress) {
  constexpr int kFinest = ViewSurface::kNumLevels - 1;
  const std::optional<double> radius_m = NeededRadius(kFinest, 0.0);
  if (!radius_m) return {};
  radius_m_ = *radius_m;
  for (PairNumbers& pair : pairs_) pair.counted = false;
  RefreshPairs();
  settling_ = true;
  return RunLevel(kFinest, std::max(1, config_.max_iterations - iterations_), progress);
}

Status Registration::RunLevel(int level, int max_iterations, const Progress& progress) {
  converged_ = false;
  for (int i = 0; i < max_iterations && !converged_; ++i) {
    const double done = static_cast<double>(iterations_) / config_.max_iterations;
    if (!progress("register", std::min(done, 0.99))) return Fail("{}", kCancelled);
    if (Status status = Iterate(level); !status) return status;
  }
  return {};
}

void Registration::Restart(const std::vector<Transform>& poses, double radius_m) {
  state_.poses = poses;
  if (terms_.chain) StartChain(*terms_.chain, state_);
  all_pairs_ = AllPairs(static_cast<int>(poses.size()));
  pairs_ = all_pairs_;
  matches_ = {};
  radius_m_ = radius_m;
}

double Registration::Residual() const {
  MatchLimits limits = Limits(1);
  limits.radius_m = config_.max_distance_m;
  return MatchViews(set_, state_.poses, AllPairs(static_cast<int>(state_.poses.size())), limits)
      .rms_m;
}

MatchLimits Registration::Limits(int level) const {
  MatchLimits limits;
  limits.radius_m = radius_m_;
  limits.max_normal_angle_rad = config_.max_normal_angle_deg * kRadPerDeg;
  limits.rejection_mad = config_.rejection_mad;
  limits.min_overlap_ratio = config_.min_overlap_ratio;
  limits.min_correspondences = config_.min_correspondences;
  limits.level = level;
  limits.symmetric = config_.symmetric;
  return limits;
}

// One search of partners and one Gauss-Newton step.
Status Registration::Iterate(int level) {
  matches_ = MatchViews(set_, state_.poses, pairs_, Limits(level));
  ++iterations_;
  information_.assign(matches_.pairs.size(), PairInformation());
  ParallelFor(static_cast<int>(information_.size()), 1, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      information_[At(i)].first = matches_.pairs[At(i)].first;
      information_[At(i)].second = matches_.pairs[At(i)].second;
      if (matches_.pairs[At(i)].counts) {
        information_[At(i)] = SumPair(matches_.pairs[At(i)], set_, state_.poses);
      }
    }
  });
  const double scale = std::max(ScaleFloor(set_), matches_.scale);
  data_scale_ = scale * scale;
  Result<PoseStep> step = SolvePoses(information_, terms_, state_, set_, data_scale_);
  if (!step) return tl::unexpected<Error>(step.error());
  step_ = std::move(*step);
  double motion = Motion(step_, set_);
  // Partners within the radius say nothing about longer ways.
  const double shorten = motion > radius_m_ ? radius_m_ / motion : 1.0;
  motion *= shorten;
  for (std::size_t i = 0; i < state_.poses.size(); ++i) {
    if (!terms_.constraints[i].held) state_.poses[i] = state_.poses[i] * Exp(shorten * step_.xi[i]);
  }
  state_.T_object_base = state_.T_object_base * Exp(shorten * step_.xi_chain[0]);
  state_.T_flange_camera = state_.T_flange_camera * Exp(shorten * step_.xi_chain[1]);
  if (!settling_) radius_m_ = std::min(radius_m_, NeededRadius(level, motion).value_or(radius_m_));
  for (std::size_t i = 0; i < pairs_.size(); ++i) pairs_[i].counted = matches_.pairs[i].counts;
  converged_ = shorten == 1.0 && (step_.size_sigma <= kStopSigma[At(level)] ||
                                  motion <= kStopMotion * set_.max_spacing_m);
  return {};
}

// Nothing where no pair counts.
std::optional<double> Registration::NeededRadius(int level, double motion_m) const {
  std::vector<double> scales;
  for (const ViewPair& pair : matches_.pairs) {
    if (pair.counts) scales.push_back(pair.scale_m);
  }
  if (scales.empty()) return std::nullopt;
  const auto middle = scales.begin() + static_cast<std::ptrdiff_t>(scales.size() / 2);
  std::nth_element(scales.begin(), middle, scales.end());
  // Nearest points of two grids lie up to about one spacing apart along the surface.
  double spacing_m = 0.0;
  for (const ViewSurface& surface : set_.surfaces) {
    spacing_m = std::max(spacing_m, surface.target_spacing_m(level));
  }
  return 2.5 * spacing_m + 4.0 * *middle + 3.0 * motion_m;
}

// Views that have met on the way, and no others, are searched on the finer levels.
void Registration::RefreshPairs() {
  MatchLimits limits = Limits(0);
  for (const ViewSurface& surface : set_.surfaces) {
    limits.radius_m = std::max(limits.radius_m, 2.5 * surface.target_spacing_m(0));
  }
  const MatchSet coarse = MatchViews(set_, state_.poses, all_pairs_, limits);
  std::vector<PairNumbers> kept;
  for (std::size_t i = 0; i < all_pairs_.size(); ++i) {
    if (coarse.pairs[i].from_first.empty() && coarse.pairs[i].from_second.empty()) continue;
    kept.push_back(all_pairs_[i]);
    for (const PairNumbers& pair : pairs_) {
      const bool same = pair.first == kept.back().first && pair.second == kept.back().second;
      if (same) kept.back().counted = pair.counted;
    }
  }
  pairs_ = std::move(kept);
}

}  // namespace fringe_fusion::internal
