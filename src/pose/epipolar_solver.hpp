#pragma once

#include <Eigen/Core>
#include <vector>

#include "fringe_fusion/geometry/transform.hpp"
#include "fringe_fusion/pose/relative_pose.hpp"

namespace fringe_fusion::epipolar {

using Vector5d = Eigen::Matrix<double, 5, 1>;

/// A match as undistorted normalised coordinates; the covariance went through the undistortion.
struct Ray {
  Eigen::Vector2d anchor = Eigen::Vector2d::Zero();
  Eigen::Vector2d observed = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();  ///< of observed
  Eigen::Matrix2d by_pixel = Eigen::Matrix2d::Identity();    ///< of observed, by its pixel
};

/// Signed distance to the epipolar line in observed pixels and its standard deviation.
[[nodiscard]] EpipolarResidual PixelResidual(const Ray& ray, const Eigen::Matrix3d& essential);

/// Undistorts one match; NaN where a pixel has no ray.
[[nodiscard]] Ray MakeRay(const Match& match, const DevicePair& devices);

/// Undistorts all matches; a match without a ray is left out.
[[nodiscard]] std::vector<Ray> MakeRays(const std::vector<Match>& matches,
                                        const DevicePair& devices);

/// Derivative of undistorted normalised coordinates with respect to the pixel, at a pixel whose
/// undistorted coordinates are known.
[[nodiscard]] Eigen::Matrix2d UndistortJacobian(const CameraModel& model,
                                                const Eigen::Vector2d& normalized);

/// Rotation and unit baseline: p_observed ~ R p_anchor + t.
struct Geometry {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::UnitX();

  [[nodiscard]] Eigen::Matrix3d Essential() const { return Hat(t) * R; }
};

/// The geometry moved by (omega, d).
[[nodiscard]] Geometry Perturb(const Geometry& geometry, const Vector5d& step);

/// The one-sided residual in standard deviations (1 when Sigma is true).
[[nodiscard]] double Residual(const Ray& ray, const Eigen::Matrix3d& essential);

/// Residual with its derivatives by pose (omega, d), anchor and observed normalised coordinates.
struct Linearization {
  double e = 0.0;
  Vector5d pose = Vector5d::Zero();
  Eigen::Vector2d anchor = Eigen::Vector2d::Zero();
  Eigen::Vector2d observed = Eigen::Vector2d::Zero();
  double variance = 0.0;  ///< of the numerator
};

/// What the derivatives of all matches share.
class Linearizer {
 public:
  explicit Linearizer(const Geometry& geometry);
  [[nodiscard]] Linearization operator()(const Ray& ray) const;

 private:
  Geometry geometry_;
  Eigen::Matrix3d essential_;
  Matrix32d basis_;
};

/// Depths (z) of a match in anchor and observed frame in units of the baseline; negative: behind.
[[nodiscard]] Eigen::Vector2d Depths(const Ray& ray, const Geometry& geometry);

/// Settings of Refine().
struct RefineOptions {
  double huber_sigma = 2.5;
  bool symmetric = false;        ///< the symmetric distance instead of the one-sided one
  double focal_anchor_px = 1.0;  ///< to state the symmetric distance in pixels
  double focal_observed_px = 1.0;
  int max_iterations = 30;
  int huber_rounds = 2;  ///< descents with all matches, the scale renewed before each
};

struct Refined {
  Geometry geometry;
  double cost = 0.0;                        ///< sum of rho(e / scale)
  double scale = 1.0;                       ///< robust scale of e, at least 1 (one-sided)
  Matrix5d information = Matrix5d::Zero();  ///< sum of J^T J of the inliers / scale^2
  Matrix5d scatter = Matrix5d::Zero();      ///< sum of psi^2 J^T J: the middle of the sandwich
  double chi2 = 0.0;                        ///< sum of psi^2 of the scaled residuals
  int num_inliers = 0;                      ///< inside the quadratic part
  bool converged = false;
};

/// Robust Levenberg-Marquardt on SO(3) x S2 from one start; at last without the matches beyond
/// four deviations.
[[nodiscard]] Refined Refine(const std::vector<Ray>& rays, const Geometry& start,
                             const RefineOptions& options);

/// max(1, 1.4826 median |e|): the scale by which stated sigmas are too small.
[[nodiscard]] double RobustScale(const std::vector<Ray>& rays, const Eigen::Matrix3d& essential);

/// Median of values; NaN when there are none. Reorders its argument.
[[nodiscard]] double MedianInPlace(std::vector<double>& values);

}  // namespace fringe_fusion::epipolar
