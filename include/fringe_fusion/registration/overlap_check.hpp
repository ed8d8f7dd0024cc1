#pragma once

#include <vector>

#include "fringe_fusion/registration/register_views.hpp"

namespace fringe_fusion {

/// How well the views lie on each other, judged on the half of the pixels that RegisterViews with
/// config.hold_out does not use, neither as samples nor as partners.
/// @param poses T_object_camera of every view of the graph, in its order.
/// @param config its search radius, angle and rejection; the same for poses to be compared.
/// @return rms of the point-to-plane residuals within rejection_mad robust standard deviations [m];
/// error when the sizes differ, a pose is not finite or no two views overlap.
[[nodiscard]] Result<double> HeldOutOverlapResidual(const ViewGraph& graph,
                                                    const std::vector<Transform>& poses,
                                                    const RegistrationConfig& config);

/// Two sets of poses of the same views, compared regardless of where the object frame lies.
struct PoseComparison {
  Transform T_reference_poses = Transform::Identity();  ///< the one rigid alignment of all views
  std::vector<double> rms_m;  ///< of every view's points between both poses, after the alignment
  double max_rms_m = 0.0;
};

/// Aligns `poses` as a whole to `reference` by the points of all views and measures what is left.
/// @return error when the sizes differ, a pose is not finite or a view has no point.
/// Ref: Umeyama, Least-squares estimation of transformation parameters, 1991.
[[nodiscard]] Result<PoseComparison> RigidAlign(const ViewGraph& graph,
                                                const std::vector<Transform>& poses,
                                                const std::vector<Transform>& reference);

}  // namespace fringe_fusion
