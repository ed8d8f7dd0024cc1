#include "fringe_fusion/registration/register_views.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "at.hpp"
#include "common/dense.hpp"
#include "registration.hpp"

namespace fringe_fusion {
namespace {

using internal::Registration;

// Share of a view in the way of another one from which a first look counts as failed.
constexpr double kMaxContradiction = 0.06;
constexpr double kMinGain = 1.02;       // of the evidence, for other places to be believed
constexpr double kMaxPriorSigma = 5.0;  // of them, where a prior is stated

// Whether some view has no partner, or would have hidden what another one saw.
bool Contradicts(const SurfaceSet& set, const std::vector<Transform>& poses, double distance_m) {
  std::vector<double> best_overlap(poses.size(), 0.0);
  bool in_the_way = false;
  for (const PairNumbers& pair : AllPairs(static_cast<int>(poses.size()))) {
    const auto a = At(pair.first);
    const auto b = At(pair.second);
    const PairCheck check =
        CheckPair(set.surfaces[a], set.surfaces[b], poses[a].inverse() * poses[b], distance_m);
    in_the_way = in_the_way || check.conflict_ratio > kMaxContradiction;
    for (const std::size_t i : {a, b})
      best_overlap[i] = std::max(best_overlap[i], check.overlap_ratio);
  }
  const double least = *std::min_element(best_overlap.begin(), best_overlap.end());
  return in_the_way || least < AssemblyConfig().min_overlap_ratio;
}

bool KeepsPriors(const PoseTerms& terms, const std::vector<Transform>& poses) {
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const PoseConstraint& prior = terms.constraints[i];
    if (!prior.has_prior) continue;
    const Vector6d e = Log(prior.T_object_camera_prior.inverse() * poses[i]);
    if (!(e.dot(prior.information * e) <= 6.0 * kMaxPriorSigma * kMaxPriorSigma)) return false;
  }
  return true;
}

// Whether some view may lie farther from its start than the first search radius reaches.
bool MayBeFarOff(const Registration& registration, const SurfaceSet& set, double radius_m) {
  const std::vector<PoseConstraint>& constraints = registration.terms().constraints;
  for (std::size_t i = 0; i < constraints.size(); ++i) {
    if (constraints[i].held) continue;
    if (!constraints[i].has_prior) return true;
    // Covariance of the middle of the view.
    Eigen::Matrix<double, 3, 6> J;
    J << -Hat(set.surfaces[i].centroid()), Eigen::Matrix3d::Identity();
    const Eigen::Matrix3d covariance =
        J * dense::SolveSymmetric(constraints[i].information, J.transpose());
    const double sigma_m = std::sqrt(dense::SymmetricEigenvalues(covariance)[2]);
    if (!(kMaxPriorSigma * sigma_m < radius_m)) return true;
  }
  return false;
}

// Finds the places of the views by shape; true when they are better than the present ones.
Result<bool> Recover(const SurfaceSet& set, double distance_m, Registration& registration,
                     const Progress& progress) {
  const std::vector<Transform>& present = registration.state().poses;
  const auto found = AssembleViews(set, {}, present, progress);
  if (!found) return Forward(found);
  const std::vector<int> everyone(present.size(), 0);
  if (!(found->evidence > kMinGain * TotalEvidence(set, present, everyone, distance_m))) {
    return false;
  }
  // The object frame stays where the first held view, else the first view, says it is.
  std::size_t anchor = present.size();
  for (std::size_t i = present.size(); i-- > 0;) {
    const bool held = registration.terms().constraints[i].held;
    if (found->group[i] == 0 && (held || anchor == present.size())) anchor = i;
  }
  std::vector<Transform> poses = present;
  const Transform T = present[anchor] * found->T_object_camera[anchor].inverse();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (found->group[i] == 0 && !registration.terms().constraints[i].held) {
      poses[i] = T * found->T_object_camera[i];
    }
  }
  if (!KeepsPriors(registration.terms(), poses)) return false;
  registration.Restart(poses, 3.0 * distance_m);
  return true;
}

Result<RegistrationResult> Solve(const ViewGraph& graph, const RegistrationConfig& config,
                                 const SurfaceSet& set, const Progress& progress) {
  const PoseTerms terms = internal::MakeTerms(graph, config.use_prior);
  Registration registration(set, config, terms, internal::StateOf(graph, terms),
                            AllPairs(static_cast<int>(graph.views.size())));
  const double rms_before_m = registration.Residual();
  const Status first = registration.RunLevel(0, std::max(1, config.max_iterations / 3), progress);
  if (!first) return tl::unexpected<Error>(first.error());
  const double distance_m = AgreementDistance(set, AssemblyConfig());
  bool recovered = false;
  if (config.recover && MayBeFarOff(registration, set, config.max_distance_m) &&
      Contradicts(set, registration.state().poses, distance_m)) {
    const auto better = Recover(set, distance_m, registration, progress);
    if (!better) return Forward(better);
    recovered = *better;
  }
  if (Status status = registration.Run(progress, recovered ? 0 : 1); !status) {
    return tl::unexpected<Error>(status.error());
  }
  RegistrationResult out = internal::Conclude(registration, graph, set);
  out.recovered = recovered;
  out.rms_before_m = rms_before_m;
  out.rms_after_m = registration.Residual();
  static_cast<void>(progress("register", 1.0));
  return out;
}

PixelSet PixelsOf(const RegistrationConfig& config) {
  return config.hold_out ? PixelSet::kRegistration : PixelSet::kAll;
}

}  // namespace

Result<RegistrationResult> RegisterViews(const ViewGraph& graph, const RegistrationConfig& config,
                                         const Progress& progress) {
  if (Status status = CheckBounds(config, "registration"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  if (Status status = Validate(graph); !status) return tl::unexpected<Error>(status.error());
  const Result<SurfaceSet> set =
      MakeSurfaces(graph.views, PixelsOf(config), config.max_points_per_view);
  if (!set) return Forward(set);
  return Solve(graph, config, *set, progress);
}

Result<RegistrationResult> RegisterUnordered(std::vector<View> views,
                                             const RegistrationConfig& config,
                                             const AssemblyConfig& assembly,
                                             const Progress& progress) {
  if (Status status = CheckBounds(config, "registration"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  ViewGraph graph;
  graph.views = std::move(views);
  for (View& view : graph.views)
    view.pose = {Transform::Identity(), Matrix6d::Zero(), PoseSource::kFile};
  if (Status status = Validate(graph); !status) return tl::unexpected<Error>(status.error());
  Result<SurfaceSet> set = MakeSurfaces(graph.views, PixelsOf(config), config.max_points_per_view);
  if (!set) return Forward(set);
  const auto found = AssembleViews(*set, assembly, {}, progress);
  if (!found) return Forward(found);
  // Only the views of the largest group go into the solution.
  ViewGraph group;
  SurfaceSet group_set;
  group_set.sigma_known = set->sigma_known;
  group_set.max_spacing_m = set->max_spacing_m;
  for (std::size_t i = 0; i < graph.views.size(); ++i) {
    if (found->group[i] != 0) continue;
    graph.views[i].pose.T_object_camera = found->T_object_camera[i];
    group.views.push_back(graph.views[i]);
    group_set.surfaces.push_back(std::move(set->surfaces[i]));
  }
  if (group.views.size() < 2) {
    return Fail("registration: no two of {} views fit together by shape", graph.views.size());
  }
  RegistrationConfig rest = config;
  rest.recover = false;
  rest.max_distance_m =
      std::max(config.max_distance_m, 3.0 * AgreementDistance(group_set, assembly));
  auto solved = Solve(group, rest, group_set, progress);
  if (!solved) return solved;
  std::vector<RegisteredView> all;
  std::size_t next = 0;
  for (std::size_t i = 0; i < graph.views.size(); ++i) {
    if (found->group[i] == 0) {
      all.push_back(solved->views[next++]);
      continue;
    }
    RegisteredView alone;
    alone.id = graph.views[i].id;
    alone.pose.source = PoseSource::kNone;
    alone.information = "none";
    all.push_back(alone);
    solved->warnings.push_back(fmt::format("view {} ({}) fits to no other view by shape: no pose",
                                           graph.views[i].id, graph.views[i].name));
  }
  solved->views = std::move(all);
  return solved;
}

}  // namespace fringe_fusion
