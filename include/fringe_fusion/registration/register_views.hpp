#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/pose/view.hpp"
#include "fringe_fusion/registration/assemble_views.hpp"
#include "fringe_fusion/registration/view_graph.hpp"

namespace fringe_fusion {

struct RegistrationConfig {
  int max_iterations = 30;
  int max_points_per_view = 20000;  ///< of each view, spread evenly over the image
  double max_distance_m = 0.003;    ///< first search radius; shrinks with the residuals
  double max_normal_angle_deg = 30.0;
  double rejection_mad = 3.0;       ///< residual limit in robust standard deviations
  double min_overlap_ratio = 0.05;  ///< least share of matched points for a pair to count
  int min_correspondences = 200;
  bool use_prior = true;  ///< add the prior poses with their covariance
  bool symmetric = true;  ///< residuals along the mean of both normals; false: point to plane
  /// Where views stand in each other's way after a first look, find their places by shape.
  bool recover = true;
  bool hold_out = false;  ///< use every other pixel, so that HeldOutOverlapResidual can judge

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
    field("symmetric", symmetric);
    field("recover", recover);
    field("hold_out", hold_out);
  }
};

/// What registration found for one view.
struct RegisteredView {
  int id = 0;
  Pose pose;                   ///< source kRegistration; kept prior if nothing overlaps it
  double overlap_ratio = 0.0;  ///< share of its sampled points that have a partner
  double rms_m = 0.0;          ///< of the point-to-plane residuals of its partners
  bool connected = false;      ///< false: no overlap with any other view
  /// What determines the pose, e.g. "surface", "surface + prior", "prior", "held".
  std::string information;
  /// Directions that the surface leaves open, in words; empty: none. They follow the priors.
  std::string weak_directions;
  double prior_sigma = 0.0;    ///< rms of pose against prior in standard deviations; 0: no prior
  double prior_shift_m = 0.0;  ///< how far the middle of the view moved from its prior
  double prior_turn_rad = 0.0;
  double doubled_m = 0.0;  ///< distance of two layers in its residuals to the others; 0: one layer
};

struct RegistrationResult {
  std::vector<RegisteredView> views;  ///< same order as the input
  std::optional<SolvedChain> chain;   ///< of ViewGraph::chain
  double rms_before_m = 0.0;          ///< point-to-plane residual over all pairs at the priors
  double rms_after_m = 0.0;
  int iterations = 0;
  bool converged = false;
  bool recovered = false;             ///< some views were found by shape, far from their priors
  std::vector<std::string> warnings;  ///< what a person should know, one sentence each
};

/// Registers all views at once: one Gauss-Newton over all poses on weighted robust point-to-plane
/// residuals, together with priors, ties and the mounting of a device. With no prior covariance at
/// all, the first view is held.
/// @return error of Validate(graph), or when a view has no usable point.
/// Ref: Neugebauer 1997; Pulli 1999; science section 4.1.
[[nodiscard]] Result<RegistrationResult> RegisterViews(const ViewGraph& graph,
                                                       const RegistrationConfig& config,
                                                       const Progress& progress = NoProgress);

/// The same without any given pose: the views assemble themselves by shape, see AssembleViews. The
/// object frame is the camera of the first view of the largest group. Views that fit to none are
/// reported, keep source kNone and are not connected.
/// @param views their poses are not read.
[[nodiscard]] Result<RegistrationResult> RegisterUnordered(std::vector<View> views,
                                                           const RegistrationConfig& config,
                                                           const AssemblyConfig& assembly,
                                                           const Progress& progress = NoProgress);

}  // namespace fringe_fusion
