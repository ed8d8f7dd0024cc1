#pragma once

#include <string>
#include <vector>

#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/registration/view_surface.hpp"

namespace fringe_fusion {

struct AssemblyConfig {
  int max_points_per_view = 800;       ///< that carry a descriptor
  double feature_radius_cells = 6.0;   ///< neighbourhood of a descriptor, of their spacing
  int num_partners = 2;                ///< most similar points that are tried for each
  int max_trials = 20000;              ///< random pairs of partners for two views
  int num_hypotheses = 4;              ///< that are refined for two views
  double max_normal_angle_deg = 30.0;  ///< between the normals of partners
  double min_overlap_ratio = 0.15;     ///< of one of two views, for their pair to count
  double max_conflict_ratio = 0.03;    ///< share of one view that the other would have hidden
  int seed = 1;

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("max_points_per_view", max_points_per_view, 50, 100000);
    field("feature_radius_cells", feature_radius_cells, 2.0, 50.0);
    field("num_partners", num_partners, 1, 100);
    field("max_trials", max_trials, 10, 100000000);
    field("num_hypotheses", num_hypotheses, 1, 100);
    field("max_normal_angle_deg", max_normal_angle_deg, 1.0, 90.0);
    field("min_overlap_ratio", min_overlap_ratio, 0.01, 1.0);
    field("max_conflict_ratio", max_conflict_ratio, 0.0, 1.0);
    field("seed", seed, 0, 2147483647);
  }
};

/// How well two views fit at some poses, both asked about the other.
struct PairCheck {
  double overlap_ratio = 0.0;   ///< larger share of one view that lies on the other
  double conflict_ratio = 0.0;  ///< larger share that lies in front of what the other measured
  double evidence = 0.0;        ///< points in agreement less a penalty for those in conflict
};

/// What an assembly found out.
struct Assembly {
  std::vector<Transform> T_object_camera;  ///< object frame: camera of the first view of the group
  std::vector<int> group;                  ///< 0: the largest one; views of a group fit together
  int num_groups = 0;
  double evidence = 0.0;  ///< sum over all pairs within the groups
};

/// Puts an unordered set of views together without any prior: similar descriptors of shape give
/// hypotheses for every pair of views, overlap and free space judge them, and the pair with the
/// most evidence over all views that it brings together is joined next. A pair that no others
/// support and that would put one view where another one looked through is refused.
/// @param set of at least two views.
/// @param starts poses to be tried first, e.g. given ones; may be empty.
/// @return error when cancelled or config is out of bounds. Views that fit to none stay alone in
/// their group.
[[nodiscard]] Result<Assembly> AssembleViews(const SurfaceSet& set, const AssemblyConfig& config,
                                             const std::vector<Transform>& starts = {},
                                             const Progress& progress = NoProgress);

/// Sum of the evidence of all pairs of views of group 0 at some poses.
[[nodiscard]] double TotalEvidence(const SurfaceSet& set, const std::vector<Transform>& poses,
                                   const std::vector<int>& group, double distance_m);

/// Distance of points in agreement after a coarse registration [m].
[[nodiscard]] double AgreementDistance(const SurfaceSet& set, const AssemblyConfig& config);

/// Compares two views in one pose. @param distance_m of points in agreement.
[[nodiscard]] PairCheck CheckPair(const ViewSurface& first, const ViewSurface& second,
                                  const Transform& T_first_second, double distance_m);

}  // namespace fringe_fusion
