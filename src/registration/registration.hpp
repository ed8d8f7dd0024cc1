#pragma once

#include <optional>
#include <vector>

#include "fringe_fusion/registration/match_views.hpp"
#include "fringe_fusion/registration/pose_system.hpp"
#include "fringe_fusion/registration/register_views.hpp"

namespace fringe_fusion::internal {

/// Constraints of the views of a graph, their ties and their device.
/// @param graph valid.
[[nodiscard]] PoseTerms MakeTerms(const ViewGraph& graph, bool use_prior);
[[nodiscard]] PoseState StateOf(const ViewGraph& graph, const PoseTerms& terms);

/// The iteration: the current state and what the last step knew about it.
class Registration {
 public:
  /// @param set must outlive the object. @param pairs to be searched for partners.
  Registration(const SurfaceSet& set, const RegistrationConfig& config, PoseTerms terms,
               PoseState state, std::vector<PairNumbers> pairs);

  /// Coarse to fine. Each level may use its share of the iterations that are left.
  [[nodiscard]] Status Run(const Progress& progress, int first_level = 0);
  /// One level alone.
  [[nodiscard]] Status RunLevel(int level, int max_iterations, const Progress& progress);
  /// Goes on from other poses.
  void Restart(const std::vector<Transform>& poses, double radius_m);

  /// Residual over all pairs as found with the first search radius, for a fair before and after.
  [[nodiscard]] double Residual() const;

  [[nodiscard]] const PoseTerms& terms() const { return terms_; }
  [[nodiscard]] const PoseState& state() const { return state_; }
  [[nodiscard]] const std::vector<Matrix6d>& covariances() const { return step_.covariance; }
  [[nodiscard]] const PoseStep& step() const { return step_; }
  [[nodiscard]] const MatchSet& matches() const { return matches_; }
  [[nodiscard]] const std::vector<PairInformation>& information() const { return information_; }
  [[nodiscard]] double data_scale() const { return data_scale_; }
  [[nodiscard]] int iterations() const { return iterations_; }
  [[nodiscard]] bool converged() const { return converged_; }

 private:
  [[nodiscard]] MatchLimits Limits(int level) const;
  [[nodiscard]] Status Iterate(int level);
  [[nodiscard]] Status Settle(const Progress& progress);
  [[nodiscard]] std::optional<double> NeededRadius(int level, double motion_m) const;
  void RefreshPairs();

  const SurfaceSet& set_;
  RegistrationConfig config_;
  PoseTerms terms_;
  PoseState state_;
  std::vector<PairNumbers> all_pairs_;  ///< that may be searched
  std::vector<PairNumbers> pairs_;      ///< that are
  double radius_m_;
  bool settling_ = false;  ///< the radius stays
  PoseStep step_;
  MatchSet matches_;
  std::vector<PairInformation> information_;
  double data_scale_ = 1.0;
  int iterations_ = 0;
  bool converged_ = false;
};

/// Fills the views, the chain and the warnings of a result.
[[nodiscard]] RegistrationResult Conclude(const Registration& registration, const ViewGraph& graph,
                                          const SurfaceSet& set);

}  // namespace fringe_fusion::internal
