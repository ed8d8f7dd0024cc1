#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
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

/// A tie between two views by their numbers.
struct PoseTie {
  int first = 0;
  int second = 0;
  Transform T_first_second = Transform::Identity();
  Matrix6d information = Matrix6d::Zero();  ///< right perturbation
};

/// A device whose mounting is solved for: T_object_camera = T_object_base * motion *
/// T_flange_camera.
struct ChainTerm {
  std::vector<int> views;                   ///< by their numbers
  std::vector<Transform> motions;           ///< T_base_flange of each
  Matrix6d information = Matrix6d::Zero();  ///< of a motion, right perturbation
  PoseConstraint object_base;               ///< `held` is not used
  PoseConstraint flange_camera;
};

/// All that ties the poses beside the surfaces.
struct PoseTerms {
  std::vector<PoseConstraint> constraints;  ///< one per view
  std::vector<PoseTie> ties;
  std::optional<ChainTerm> chain;
};

/// The unknowns.
struct PoseState {
  std::vector<Transform> poses;  ///< T_object_camera
  Transform T_object_base = Transform::Identity();
  Transform T_flange_camera = Transform::Identity();
};

/// Where the state contradicts a device: residual of a prior, a tie or a reading.
[[nodiscard]] Vector6d TieResidual(const PoseTie& tie, const PoseState& state);
[[nodiscard]] Vector6d ChainResidual(const ChainTerm& chain, std::size_t reading,
                                     const PoseState& state);
/// Information of ChainResidual.
[[nodiscard]] Matrix6d ChainInformation(const ChainTerm& chain, const PoseState& state);

/// Fits the mountings of a chain to the poses, from 24 starts all around.
void StartChain(const ChainTerm& chain, PoseState& state);

/// One Gauss-Newton step for all unknowns.
struct PoseStep {
  std::vector<Vector6d> xi;          ///< right perturbations; zero for held views
  std::vector<Matrix6d> covariance;  ///< of the poses after convergence; zero for held views
  std::array<Vector6d, 2> xi_chain = {Vector6d::Zero(), Vector6d::Zero()};  ///< base, camera
  std::array<Matrix6d, 2> covariance_chain = {Matrix6d::Zero(), Matrix6d::Zero()};
  double size_sigma =
      0.0;  ///< rms size of the step in its own standard deviations, all poses joint
};

/// Solves the joint system of all pairs, priors, ties and readings. The latter count fully up to
/// three standard deviations and ever less beyond, so that one wrong device pose does not bend the
/// surfaces.
/// @param data_scale variance factor of all residuals, see MatchSet::scale (squared).
/// A view without prior is taken to be known to within its own size, which keeps directions that
/// nothing determines where they are.
/// @return error when the system has no finite solution.
[[nodiscard]] Result<PoseStep> SolvePoses(const std::vector<PairInformation>& pairs,
                                          const PoseTerms& terms, const PoseState& state,
                                          const SurfaceSet& set, double data_scale);

/// Inverse of a positive semidefinite covariance; directions below 1e-8 rad or m count as 1e-8.
[[nodiscard]] Matrix6d InformationOf(const Matrix6d& covariance);

}  // namespace fringe_fusion
