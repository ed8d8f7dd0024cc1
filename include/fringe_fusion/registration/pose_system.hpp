#pragma once

#include <Eigen/Core>
#include <vector>

#include "fringe_fusion/registration/match_views.hpp"

namespace fringe_fusion {

/// What the partners of one pair of views say about the motion of the first against the second.
/// Motions are twists of the object frame, reduced to the middle of the overlap and with rotations
/// in metres at its radius: y = S (omega, v).
struct PairInformation {
  int first = 0;
  int second = 0;
  Matrix6d S = Matrix6d::Identity();
  Matrix6d hessian = Matrix6d::Zero();      ///< sum of w J^T J [1/m^2]
  Vector6d gradient = Vector6d::Zero();     ///< sum of w J^T r [1/m]
  Matrix6d information = Matrix6d::Zero();  ///< hessian without what noise of the normals adds
};

/// Sums up the partners of a pair and drops every direction in which they say nothing.
///
/// Noisy normals make even a plane look as if it resisted sliding in itself: with n = n0 + e the
/// expectation of n n^T is n0 n0^T + cov(e). Half the difference of the two normals of a match has
/// the covariance of their mean, so that its share can be taken off. Directions that keep less than
/// half of their information, or less than 1e-7 of the strongest one, are removed.
[[nodiscard]] PairInformation SumPair(const ViewPair& pair, const SurfaceSet& set,
                                      const std::vector<Transform>& poses);

/// How the solution may move one view.
struct PoseConstraint {
  bool held = false;
  bool has_prior = false;
  Transform T_object_camera_prior = Transform::Identity();
  Matrix6d information = Matrix6d::Zero();  ///< of the prior, right perturbation
};

/// One Gauss-Newton step for all poses.
struct PoseStep {
  std::vector<Vector6d> xi;          ///< right perturbations; zero for held views
  std::vector<Matrix6d> covariance;  ///< of the poses after convergence; zero for held views
  double size_sigma =
      0.0;  ///< rms size of the step in its own standard deviations, all poses joint
};

/// Solves the joint system of all pairs and priors.
/// @param data_scale variance factor of all residuals, see MatchSet::scale (squared).
/// A view without prior is taken to be known to within its own size, which keeps directions that
/// nothing determines where they are.
/// @return error when the system has no finite solution.
[[nodiscard]] Result<PoseStep> SolvePoses(const std::vector<PairInformation>& pairs,
                                          const std::vector<PoseConstraint>& constraints,
                                          const std::vector<Transform>& poses,
                                          const SurfaceSet& set, double data_scale);

/// Inverse of a positive semidefinite covariance; directions below 1e-8 rad or m count as 1e-8.
[[nodiscard]] Matrix6d InformationOf(const Matrix6d& covariance);

}  // namespace fringe_fusion
