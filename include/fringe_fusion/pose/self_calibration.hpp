#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "fringe_fusion/pose/relative_pose.hpp"

namespace fringe_fusion {

constexpr double kFree = std::numeric_limits<double>::infinity();

/// What is known of the intrinsics of a device beside its nominal model: standard deviations of
/// the nominal values; 0: exact, kFree: unknown.
struct IntrinsicsPrior {
  double focal_ratio = 0.0;   ///< of both focal lengths, relative; their ratio is kept
  double principal_px = 0.0;  ///< of cx and cy [px]
  double k1 = 0.0;            ///< of the first radial distortion term
};

/// Both focal lengths and the pose from one pair of images.
struct PairCalibration {
  DevicePair devices;  ///< with the focal lengths found
  RelativePose pose;
  double sigma_focal_anchor_ratio = 0.0;    ///< relative standard deviation
  double sigma_focal_observed_ratio = 0.0;  ///< relative standard deviation
  /// Of (omega, d, log f_anchor, log f_observed).
  Eigen::Matrix<double, 7, 7> covariance = Eigen::Matrix<double, 7, 7>::Zero();
  double condition = 0.0;              ///< of the data alone, scaled to unit diagonal
  double axes_out_of_plane_deg = 0.0;  ///< 0: both optical axes and the baseline are coplanar
  bool linear_start = false;  ///< Bougnoux's formula gave the start, else the nominal values did
};

/// Self-calibrates two focal lengths from one pair without a target. Principal points and
/// distortion (as a map of pixels) are taken from `nominal`; its focal lengths are a start only,
/// and a prior where `anchor` or `observed` state one.
///
/// One pair determines at most two numbers beside the pose. Layouts that do not: optical axes in
/// one plane with the baseline (the usual converging mount), a flat scene, an unknown principal
/// point. They are refused with the reason and the cure.
/// Start: five-point pose with the nominal values and Bougnoux's formula on the weighted
/// eight-point fundamental matrix; then all seven parameters by the one-sided residual.
/// @param anchor, observed what is known of each device; focal_ratio 0 holds it.
/// @return error for bad input, a singular layout, or focal lengths outside a third to three times
/// the nominal ones.
/// Ref: Bougnoux, "From projective to Euclidean space under any practical situation", ICCV 1998,
/// eq. 12; science 3.4.
[[nodiscard]] Result<PairCalibration> SelfCalibratePair(const std::vector<Match>& matches,
                                                        const DevicePair& nominal,
                                                        const IntrinsicsPrior& anchor,
                                                        const IntrinsicsPrior& observed,
                                                        const EpipolarConfig& config);

/// Focal lengths of two devices from a fundamental matrix p_o^T F p_a = 0 in undistorted pixels.
/// @param principal_anchor, principal_observed principal points [px].
/// @return (f_anchor, f_observed) [px]; error when a square is not positive and finite.
[[nodiscard]] Result<Eigen::Vector2d> FocalLengthsOf(const Eigen::Matrix3d& F,
                                                     const Eigen::Vector2d& principal_anchor,
                                                     const Eigen::Vector2d& principal_observed);

/// Angle between the observed device's optical axis and the plane of the anchor's axis and the
/// baseline [deg], the larger of both ways round; 0 is singular for self-calibration.
[[nodiscard]] double AxesOutOfPlaneDeg(const Transform& T_observed_anchor);

}  // namespace fringe_fusion
