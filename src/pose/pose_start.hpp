#pragma once

#include <optional>
#include <vector>

#include "epipolar_solver.hpp"

namespace fringe_fusion::epipolar {

/// A homography observed = H anchor and how well it explains the matches.
struct PlaneFit {
  bool valid = false;
  Eigen::Matrix3d H = Eigen::Matrix3d::Identity();
  double median_sigma = 0.0;  ///< median |residual| of both components in standard deviations
  bool preferred = false;     ///< over the epipolar model, by GRIC
};

/// Robust fit of a homography (four-point, least median of squares, then weighted least squares).
[[nodiscard]] PlaneFit FitPlane(const std::vector<Ray>& rays);

/// GRIC of both models over the same matches: true when the plane explains them better.
/// @param scale robust scale of the epipolar residuals.
/// Ref: Torr 1998: sum min(e^2, 2 (r - d)) + d n log r + k log(r n), r = 4.
[[nodiscard]] bool PrefersPlane(const std::vector<Ray>& rays, const Eigen::Matrix3d& H,
                                const Eigen::Matrix3d& essential, double scale);

/// Start geometries by five-point hypotheses, best first; distinct ones only. Deterministic.
/// @param rays a sample of all matches, a few hundred.
[[nodiscard]] std::vector<Geometry> FivePointStarts(const std::vector<Ray>& rays, int max_starts);

/// The geometries that a homography allows.
[[nodiscard]] std::vector<Geometry> HomographyStarts(const Eigen::Matrix3d& H,
                                                     const std::vector<Ray>& rays);

/// All starts for the refinement: five-point, homography, prior.
[[nodiscard]] std::vector<Geometry> MakeStarts(const std::vector<Ray>& sample,
                                               const PlaneFit& plane,
                                               const std::optional<Geometry>& prior);

/// Of the four poses of an essential matrix the one with most points before both devices.
/// Ref: Hartley & Zisserman, Multiple View Geometry, 2004, result 9.19.
[[nodiscard]] Geometry DecomposeEssential(const Eigen::Matrix3d& essential,
                                          const std::vector<Ray>& rays);

/// Share of matches before both devices.
[[nodiscard]] double CheiralityRatio(const std::vector<Ray>& rays, const Geometry& geometry);

/// Median residual in deviations after the best pure rotation: small without a baseline.
[[nodiscard]] double RotationOnlyResidual(const std::vector<Ray>& rays);

/// Every n-th match so that at most max_count remain.
[[nodiscard]] std::vector<Ray> Thin(const std::vector<Ray>& rays, std::size_t max_count);

/// Whether two geometries are the same within 1e-3 rad.
[[nodiscard]] bool IsSame(const Geometry& a, const Geometry& b);

}  // namespace fringe_fusion::epipolar
