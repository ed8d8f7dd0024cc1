#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "fringe_fusion/geometry/transform.hpp"
#include "fringe_fusion/pose/match.hpp"

namespace fringe_fusion {

using Matrix5d = Eigen::Matrix<double, 5, 5>;
using Matrix32d = Eigen::Matrix<double, 3, 2>;

/// Orthonormal basis of the plane across a unit vector: how a direction is perturbed,
/// t <- cos|d| t + sin|d| B d / |d|.
/// Ref: science 3.3; Householder reflection that takes the third axis to t.
[[nodiscard]] Matrix32d TangentBasis(const Eigen::Vector3d& unit);

/// Pose of two devices up to the length of the baseline, from matches alone.
struct RelativePose {
  /// p_observed = T_observed_anchor p_anchor with a translation of unit length.
  Transform T_observed_anchor = Transform::Identity();
  /// Of (omega, d): R Exp(omega), and the translation moved by d along TangentBasis.
  Matrix5d covariance = Matrix5d::Zero();
  int num_matches = 0;
  int num_inliers = 0;              ///< within 3 deviations
  double median_residual_px = 0.0;  ///< absolute distance to the epipolar line, observed pixels
  double rms_residual_px = 0.0;     ///< of the inliers
  double reduced_chi2 = 0.0;        ///< of the inliers; 1 when the stated sigmas are true
  double condition = 0.0;           ///< of the normal equations, scaled to unit diagonal
  double cheirality_ratio = 0.0;    ///< of inliers before both devices
  bool planar = false;              ///< a homography explains the matches as well (GRIC)
  double ambiguity_chi2 = 0.0;      ///< by which the next best pose fits worse; infinite: none
};

/// Estimates the pose of camera and projector (or of any two devices) from dense matches.
///
/// Start: five-point hypotheses by least median of squares, and the decompositions of a homography
/// for scenes that are nearly planar; every start is refined, and cheirality over all matches and
/// the residual decide. Refinement: the one-sided residual
///   e = p^T l / sqrt(l^T Sigma l), l = E c, E = [t] R,
/// which is exact because only p carries noise; Huber weights; Gauss-Newton on SO(3) x S2.
/// Matches of several views of the same rig may be given together; a second view also decides
/// between the two poses that a single plane allows.
/// @param T_observed_anchor_prior rough pose, any length of translation: one more start, and it
/// decides between the two poses of a plane; none: an undecided plane is refused.
/// @return error for every input of CheckMatches, for too few inliers, an undetermined direction
/// (no baseline), points behind a device, an undecided plane.
/// Ref: science 3.1-3.3; Nister, "An efficient solution to the five-point relative pose problem",
/// PAMI 26(6), 2004; Torr, "Geometric motion segmentation and model selection", 1998 (GRIC).
[[nodiscard]] Result<RelativePose> EstimateRelativePose(
    const std::vector<Match>& matches, const DevicePair& devices, const EpipolarConfig& config,
    const std::optional<Transform>& T_observed_anchor_prior = std::nullopt);

/// Signed distance of one match to its epipolar line in observed pixels and in deviations.
struct EpipolarResidual {
  double distance_px = 0.0;
  double sigma = 0.0;  ///< standard deviation of distance_px from the stated noise [px]
};
/// NaN where a pixel has no ray.
[[nodiscard]] EpipolarResidual ResidualOf(const Match& match, const DevicePair& devices,
                                          const Transform& T_observed_anchor);

/// A metric pose with the covariance of its right perturbation T Exp(xi), rotation first.
struct MetricPose {
  Transform T_observed_anchor = Transform::Identity();  ///< [m]
  Matrix6d covariance = Matrix6d::Zero();
};

/// Adds the length of the baseline to a relative pose.
/// @return error when the length is not positive or its sigma negative.
/// Ref: science 3.3: Sigma_t = b^2 B Sigma_d B^T + t t^T sigma_b^2.
[[nodiscard]] Result<MetricPose> LiftToMetric(const RelativePose& pose, double baseline_m,
                                              double sigma_baseline_m);

}  // namespace fringe_fusion
