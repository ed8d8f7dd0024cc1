#include "epipolar_solver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/dense.hpp"
#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::epipolar {
namespace {

constexpr int kMatchesPerChunk = 1024;

using Row35 = Eigen::Matrix<double, 3, 5>;

/// Normal equations of one step.
struct RaySums {
  Matrix5d hessian = Matrix5d::Zero();      ///< sum of w J^T J
  Matrix5d information = Matrix5d::Zero();  ///< sum of J^T J of the inliers
  Matrix5d scatter = Matrix5d::Zero();      ///< sum of psi^2 J^T J
  Vector5d gradient = Vector5d::Zero();
  double cost = 0.0;
  double chi2 = 0.0;
  int num_inliers = 0;
  bool with_scatter = false;

  void Add(double e, const Vector5d& jacobian, double k) {
    const double magnitude = std::abs(e);
    const bool inlier = magnitude <= k;
    const double weight = inlier ? 1.0 : k / magnitude;
    const double psi = weight * e;
    cost += inlier ? e * e : 2.0 * k * magnitude - k * k;
    chi2 += psi * psi;
    const Matrix5d outer = jacobian * jacobian.transpose();
    hessian += weight * outer;
    if (with_scatter) scatter += psi * psi * outer;
    gradient += psi * jacobian;
    if (!inlier) return;
    information += outer;
    ++num_inliers;
  }
  void Add(const RaySums& other) {
    hessian += other.hessian;
    information += other.information;
    scatter += other.scatter;
    gradient += other.gradient;
    cost += other.cost;
    chi2 += other.chi2;
    num_inliers += other.num_inliers;
  }
};

/// Distances of both points to their lines [px] with derivatives, the objective of the thesis.
class SymmetricLinearizer {
 public:
  SymmetricLinearizer(const Geometry& geometry, const RefineOptions& options)
      : geometry_(geometry),
        essential_(geometry.Essential()),
        basis_(TangentBasis(geometry.t)),
        options_(options) {}

  void AddTo(RaySums& sums, const Ray& ray, double scale) const {
    const Eigen::Vector3d a = ray.anchor.homogeneous();
    const Eigen::Vector3d o = ray.observed.homogeneous();
    const Eigen::Vector3d Ra = geometry_.R * a;
    Row35 line_by_pose;
    line_by_pose << -Hat(geometry_.t) * geometry_.R * Hat(a), -Hat(Ra) * basis_;
    AddDistance(sums, o, essential_ * a, line_by_pose, options_.focal_observed_px / scale);
    const Eigen::Vector3d back = geometry_.R.transpose() * o.cross(geometry_.t);
    Row35 back_by_pose;
    back_by_pose << Hat(back), geometry_.R.transpose() * Hat(o) * basis_;
    AddDistance(sums, a, back, back_by_pose, options_.focal_anchor_px / scale);
  }

 private:
  void AddDistance(RaySums& sums, const Eigen::Vector3d& point, const Eigen::Vector3d& line,
                   const Row35& line_by_pose, double factor) const {
    const double norm = line.head<2>().norm();
    const double value = point.dot(line);
    const Vector5d by_pose =
        line_by_pose.transpose() * point / norm -
        value / (norm * norm * norm) * line_by_pose.topRows<2>().transpose() * line.head<2>();
    sums.Add(factor * value / norm, factor * by_pose, options_.huber_sigma);
  }

  Geometry geometry_;
  Eigen::Matrix3d essential_;
  Matrix32d basis_;
  RefineOptions options_;
};

RaySums SumUp(const std::vector<Ray>& rays, const Geometry& geometry, const RefineOptions& options,
              double scale) {
  const int count = static_cast<int>(rays.size());
  std::vector<RaySums> parts(
      static_cast<std::size_t>((count + kMatchesPerChunk - 1) / kMatchesPerChunk));
  const Linearizer one_sided(geometry);
  const SymmetricLinearizer symmetric(geometry, options);
  ParallelFor(count, kMatchesPerChunk, [&](int begin, int end) {
    RaySums& part = parts[static_cast<std::size_t>(begin / kMatchesPerChunk)];
    part.with_scatter = options.symmetric;
    for (int i = begin; i < end; ++i) {
      const Ray& ray = rays[static_cast<std::size_t>(i)];
      if (options.symmetric) {
        symmetric.AddTo(part, ray, scale);
      } else {
        const Linearization at = one_sided(ray);
        part.Add(at.e / scale, at.pose / scale, options.huber_sigma);
      }
    }
  });
  RaySums sums;
  for (const RaySums& part : parts) sums.Add(part);
  return sums;
}

/// Robust scale of the residuals that are minimised.
double ScaleOf(const std::vector<Ray>& rays, const Geometry& geometry,
               const RefineOptions& options) {
  const Eigen::Matrix3d essential = geometry.Essential();
  if (!options.symmetric) return RobustScale(rays, essential);
  std::vector<double> distances;
  distances.reserve(rays.size());
  for (const Ray& ray : rays) {
    const Eigen::Vector3d line = essential * ray.anchor.homogeneous();
    distances.push_back(options.focal_observed_px * std::abs(ray.observed.homogeneous().dot(line)) /
                        line.head<2>().norm());
  }
  return std::max(1e-9, 1.4826 * MedianInPlace(distances));
}

/// Levenberg-Marquardt with a fixed scale; true when it converged.
bool Descend(const std::vector<Ray>& rays, const RefineOptions& options, double scale,
             Geometry& geometry) {
  double damping = 1e-4;
  RaySums sums = SumUp(rays, geometry, options, scale);
  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    Matrix5d damped = sums.hessian;
    damped.diagonal() *= 1.0 + damping;
    const Vector5d step = -dense::SolveSymmetric(damped, sums.gradient);
    if (!step.allFinite()) return false;
    const Geometry moved = Perturb(geometry, step);
    const RaySums next = SumUp(rays, moved, options, scale);
    if (next.cost <= sums.cost) {
      // In standard deviations, so that the limit holds for any noise and number of matches.
      const double size = std::sqrt(step.dot(sums.hessian * step));
      geometry = moved;
      sums = next;
      damping = std::max(1e-12, 0.1 * damping);
      if (size < 1e-4) return true;
    } else {
      damping *= 10.0;
      if (damping > 1e10) return true;  // no descent left at the precision of the numbers
    }
  }
  return false;
}

}  // namespace

double MedianInPlace(std::vector<double>& values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Eigen::Matrix2d UndistortJacobian(const CameraModel& model, const Eigen::Vector2d& normalized) {
  const Eigen::Matrix2d forward =
      ProjectWithJacobian(model, normalized.homogeneous()).jacobian.leftCols<2>();
  return forward.inverse();
}

Ray MakeRay(const Match& match, const DevicePair& devices) {
  Ray ray;
  ray.anchor = Undistort(devices.anchor, match.anchor_px);
  ray.observed = Undistort(devices.observed, match.observed_px);
  ray.by_pixel = UndistortJacobian(devices.observed, ray.observed);
  ray.covariance = ray.by_pixel * match.covariance_px2 * ray.by_pixel.transpose();
  return ray;
}

std::vector<Ray> MakeRays(const std::vector<Match>& matches, const DevicePair& devices) {
  std::vector<Ray> rays(matches.size());
  ParallelFor(static_cast<int>(matches.size()), kMatchesPerChunk, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      const auto k = static_cast<std::size_t>(i);
      rays[k] = MakeRay(matches[k], devices);
    }
  });
  rays.erase(std::remove_if(rays.begin(), rays.end(),
                            [](const Ray& ray) {
                              return !ray.anchor.allFinite() || !ray.observed.allFinite() ||
                                     !ray.covariance.allFinite();
                            }),
             rays.end());
  return rays;
}

Geometry Perturb(const Geometry& geometry, const Vector5d& step) {
  Geometry out;
  out.R = geometry.R * ExpRotation(step.head<3>());
  const Eigen::Vector2d d = step.tail<2>();
  const double angle = d.norm();
  // sin(x)/x for a small angle.
  const double ratio = angle < 1e-8 ? 1.0 : std::sin(angle) / angle;
  const Eigen::Vector3d along = TangentBasis(geometry.t) * d;
  out.t = (std::cos(angle) * geometry.t + ratio * along).normalized();
  return out;
}

double Residual(const Ray& ray, const Eigen::Matrix3d& essential) {
  const Eigen::Vector3d line = essential * ray.anchor.homogeneous();
  const Eigen::Vector2d normal = line.head<2>();
  return ray.observed.homogeneous().dot(line) / std::sqrt(normal.dot(ray.covariance * normal));
}

EpipolarResidual PixelResidual(const Ray& ray, const Eigen::Matrix3d& essential) {
  const Eigen::Vector3d line = essential * ray.anchor.homogeneous();
  const Eigen::Vector2d normal = line.head<2>();
  // The line's gradient in pixels: chain rule through the undistortion.
  const double norm = (ray.by_pixel.transpose() * normal).norm();
  return {ray.observed.homogeneous().dot(line) / norm,
          std::sqrt(normal.dot(ray.covariance * normal)) / norm};
}

Linearizer::Linearizer(const Geometry& geometry)
    : geometry_(geometry), essential_(geometry.Essential()), basis_(TangentBasis(geometry.t)) {}

Linearization Linearizer::operator()(const Ray& ray) const {
  const Eigen::Vector3d a = ray.anchor.homogeneous();
  const Eigen::Vector3d o = ray.observed.homogeneous();
  const Eigen::Vector3d Ra = geometry_.R * a;
  const Eigen::Vector3d line = geometry_.t.cross(Ra);
  const Eigen::Vector2d normal = line.head<2>();
  const Eigen::Vector2d weighted = ray.covariance * normal;
  // The derivative of the line through a 3-vector g is g . d(line): both terms of the quotient
  // rule are linear in d(line).
  Linearization out;
  out.variance = normal.dot(weighted);
  const double deviation = std::sqrt(out.variance);
  const double numerator = o.dot(line);
  out.e = numerator / deviation;
  Eigen::Vector3d g = o / deviation;
  g.head<2>() -= numerator / (out.variance * deviation) * weighted;
  // line = t x R a: by omega -[t] R [a] omega, by d -[R a] B d.
  const Eigen::Vector3d gt = g.cross(geometry_.t);  // g^T [t]
  out.pose.head<3>() = a.cross(geometry_.R.transpose() * gt);
  out.pose.tail<2>() = basis_.transpose() * Ra.cross(g);
  out.anchor = (essential_.transpose() * g).head<2>();
  out.observed = normal / deviation;
  return out;
}

Eigen::Vector2d Depths(const Ray& ray, const Geometry& geometry) {
  const Eigen::Vector3d Ra = geometry.R * ray.anchor.homogeneous();
  const Eigen::Vector3d o = ray.observed.homogeneous();
  const Eigen::Vector3d normal = o.cross(Ra);
  const double squared = normal.squaredNorm();
  return {-o.cross(geometry.t).dot(normal) / squared, -Ra.cross(geometry.t).dot(normal) / squared};
}

double RobustScale(const std::vector<Ray>& rays, const Eigen::Matrix3d& essential) {
  std::vector<double> residuals;
  residuals.reserve(rays.size());
  for (const Ray& ray : rays) residuals.push_back(std::abs(Residual(ray, essential)));
  return std::max(1.0, 1.4826 * MedianInPlace(residuals));
}

Refined Refine(const std::vector<Ray>& rays, const Geometry& start, const RefineOptions& options) {
  // Beyond this many deviations a match is none: Huber weights alone would let it pull.
  constexpr double kRejectSigma = 4.0;
  Refined out;
  out.geometry = start;
  // The scale follows the residuals: a start far off must not make Huber weights of everything.
  for (int round = 0; round < options.huber_rounds; ++round) {
    out.scale = ScaleOf(rays, out.geometry, options);
    out.converged = Descend(rays, options, out.scale, out.geometry);
  }
  std::vector<Ray> kept = rays;
  for (int round = 0; round < 2; ++round) {
    // The scale in terms of the one-sided residual, also where another objective is minimised.
    const Eigen::Matrix3d essential = out.geometry.Essential();
    const double limit = kRejectSigma * RobustScale(kept, essential);
    kept.clear();
    for (const Ray& ray : rays) {
      if (std::abs(Residual(ray, essential)) <= limit) kept.push_back(ray);
    }
    out.scale = ScaleOf(kept, out.geometry, options);
    out.converged = Descend(kept, options, out.scale, out.geometry);
  }
  const RaySums sums = SumUp(kept, out.geometry, options, out.scale);
  out.information = sums.information;
  out.scatter = sums.scatter;
  out.chi2 = sums.chi2;
  out.num_inliers = sums.num_inliers;
  RefineOptions one_sided = options;
  one_sided.symmetric = false;
  out.cost = SumUp(rays, out.geometry, one_sided, out.scale).cost;
  return out;
}

}  // namespace fringe_fusion::epipolar
