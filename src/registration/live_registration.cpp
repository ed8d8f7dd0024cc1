#include "fringe_fusion/registration/live_registration.hpp"

#include <algorithm>
#include <utility>

#include "at.hpp"
#include "registration.hpp"

namespace fringe_fusion {
namespace {}  // namespace

Result<LiveRegistration> LiveRegistration::Create(const RegistrationConfig& config,
                                                  int max_neighbors) {
  if (Status status = CheckBounds(config, "registration"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  if (!(max_neighbors >= 1)) {
    return Fail("registration: max_neighbors = {} must be at least 1", max_neighbors);
  }
  return LiveRegistration(config, max_neighbors);
}

// Views with the most samples near those of a surface, the nearest first.
std::vector<int> LiveRegistration::NeighborsOf(const ViewSurface& surface,
                                               const Transform& T) const {
  std::vector<std::pair<int, int>> counts;
  const auto radius = static_cast<float>(config_.max_distance_m + surface.target_spacing_m(0));
  for (std::size_t k = 0; k < views_.size(); ++k) {
    const Transform T_other_this = state_.at(views_[k].id).pose.T_object_camera.inverse() * T;
    const Eigen::Isometry3f T_float = T_other_this.cast<float>();
    int count = 0;
    const std::vector<int>& samples = surface.samples(0);
    for (std::size_t i = 0; i < samples.size(); i += 8) {
      const SurfacePoint& point = surface.points()[At(samples[i])];
      const Eigen::Vector3f there = T_float * point.point;
      if (!set_.surfaces[k].FacesSensor(there, T_float.linear() * point.normal)) continue;
      if (set_.surfaces[k].Nearest(there, radius, 0) >= 0) ++count;
    }
    if (count > 0) counts.emplace_back(-count, static_cast<int>(k));
  }
  std::sort(counts.begin(), counts.end());
  std::vector<int> neighbors;
  for (const auto& entry : counts) {
    if (static_cast<int>(neighbors.size()) < max_neighbors_) neighbors.push_back(entry.second);
  }
  return neighbors;
}

Result<RegisteredView> LiveRegistration::Add(const View& view) {
  if (Status status = Validate(view); !status) return tl::unexpected<Error>(status.error());
  if (state_.count(view.id) > 0) {
    return Fail("view {} ({}): its id is known already", view.id, view.name);
  }
  auto surface =
      ViewSurface::Make(view, config_.hold_out ? PixelSet::kRegistration : PixelSet::kAll,
                        config_.max_points_per_view);
  if (!surface) return Forward(surface);
  const std::vector<int> neighbors = NeighborsOf(*surface, view.pose.T_object_camera);
  // The new view is the last of a small set; the set is taken apart again afterwards.
  ViewGraph graph;
  SurfaceSet small;
  for (const int k : neighbors) {
    graph.views.push_back({views_[At(k)].id, views_[At(k)].name, {}, {}});
    graph.views.back().pose.T_object_camera = state_.at(views_[At(k)].id).pose.T_object_camera;
    small.surfaces.push_back(std::move(set_.surfaces[At(k)]));
  }
  graph.views.push_back({view.id, view.name, {}, view.pose});
  small.surfaces.push_back(std::move(*surface));
  FinishSurfaces(small);
  PoseTerms terms;
  PoseState state;
  std::vector<PairNumbers> pairs;
  const auto last = static_cast<int>(neighbors.size());
  for (const View& one : graph.views) {
    PoseConstraint constraint;
    constraint.held = true;
    constraint.T_object_camera_prior = one.pose.T_object_camera;
    terms.constraints.push_back(constraint);
    state.poses.push_back(one.pose.T_object_camera);
  }
  PoseConstraint& prior = terms.constraints.back();
  prior.held = neighbors.empty();
  prior.has_prior = config_.use_prior && view.pose.covariance.norm() > 0.0;
  if (prior.has_prior) prior.information = InformationOf(view.pose.covariance);
  for (int k = 0; k < last; ++k) pairs.push_back({k, last, false});
  internal::Registration registration(small, config_, terms, state, pairs);
  Status status = neighbors.empty() ? Status{} : registration.Run(NoProgress);
  RegisteredView added;
  added.id = view.id;
  added.pose = view.pose;
  if (status && !neighbors.empty()) {
    added = internal::Conclude(registration, graph, small).views.back();
  }
  for (int k = 0; k < last; ++k) {
    set_.surfaces[At(neighbors[At(k)])] = std::move(small.surfaces[At(k)]);
  }
  if (!status) return tl::unexpected<Error>(status.error());
  set_.surfaces.push_back(std::move(small.surfaces.back()));
  views_.push_back(view);
  state_[view.id] = added;
  return added;
}

Result<RegistrationResult> LiveRegistration::Solve(const std::vector<ViewTie>& ties,
                                                   const std::optional<DeviceChain>& chain,
                                                   const Progress& progress) {
  ViewGraph graph;
  graph.views = views_;
  graph.ties = ties;
  graph.chain = chain;
  auto result = RegisterViews(graph, config_, progress);
  if (!result) return result;
  for (const RegisteredView& view : result->views) state_[view.id] = view;
  return result;
}

}  // namespace fringe_fusion
