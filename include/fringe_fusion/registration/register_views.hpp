#pragma once

#include <vector>

#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/pose/view.hpp"

namespace fringe_fusion {

/// All views of one object with their prior poses. The pose of a view with zero covariance is held.
struct ViewGraph {
  std::vector<View> views;
};

struct RegistrationConfig {
  int max_iterations = 30;
  int max_points_per_view = 20000;  ///< of each view, spread evenly over the image
  double max_distance_m = 0.003;    ///< first search radius; shrinks with the residuals
  double max_normal_angle_deg = 30.0;
  double rejection_mad = 3.0;       ///< residual limit in robust standard deviations
  double min_overlap_ratio = 0.05;  ///< least share of matched points for a pair to count
  int min_correspondences = 200;
  bool use_prior = true;  ///< add the prior poses with their covariance

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("max_iterations", max_iterations, 1, 1000);
    field("max_points_per_view", max_points_per_view, 100, 100000000);
    field("max_distance_m", max_distance_m, 1e-6, 10.0);
    field("max_normal_angle_deg", max_normal_angle_deg, 1.0, 90.0);
    field("rejection_mad", rejection_mad, 1.0, 100.0);
    field("min_overlap_ratio", min_overlap_ratio, 0.0, 1.0);
    field("min_correspondences", min_correspondences, 6, 100000000);
    field("use_prior", use_prior);
  }
};

/// What registration found for one view.
struct RegisteredView {
  int id = 0;
  Pose pose;                   ///< source kRegistration; kept prior if nothing overlaps it
  double overlap_ratio = 0.0;  ///< share of its sampled points that have a partner
  double rms_m = 0.0;          ///< of the point-to-plane residuals of its partners
  bool connected = false;      ///< false: no overlap with any other view
};

struct RegistrationResult {
  std::vector<RegisteredView> views;  ///< same order as the input
  double rms_before_m = 0.0;          ///< point-to-plane residual over all pairs at the priors
  double rms_after_m = 0.0;
  int iterations = 0;
  bool converged = false;
};

/// Registers all views at once: one Gauss-Newton over all poses on weighted robust point-to-plane
/// residuals, on top of the prior poses. With no prior covariance at all, the first view is held.
/// @return error when fewer than two views, a view without points or a non-finite pose is given.
/// Ref: Neugebauer 1997; Pulli 1999; science section 4.1.
[[nodiscard]] Result<RegistrationResult> RegisterViews(const ViewGraph& graph,
                                                       const RegistrationConfig& config,
                                                       const Progress& progress = NoProgress);

}  // namespace fringe_fusion
