#include "ray_solver.hpp"

#include <cmath>
#include <limits>

namespace fringe_fusion::triangulation {
namespace {
constexpr int kMaxIterations = 15;
constexpr double kRelativeStep = 1e-10;
}  // namespace

RaySolver::RaySolver(const CellCalibration& calibration)
    : projector_(calibration.projector),
      R_projector_camera_(calibration.T_projector_camera.linear()),
      t_projector_camera_(calibration.T_projector_camera.translation()) {}

// Without distortion each coordinate gives a linear equation in lambda, here for u:
// (a_x - u' a_z) lambda = u' t_z - t_x with u' = (u - c_x) / f_x.
double RaySolver::ClosedForm(const Eigen::Vector3d& ray_projector, const Eigen::Vector2d& pixel,
                             const Eigen::Vector2d& weight) const {
  const Eigen::Vector2d normalized((pixel.x() - projector_.cx) / projector_.fx,
                                   (pixel.y() - projector_.cy) / projector_.fy);
  const Eigen::Vector3d& t = t_projector_camera_;
  double numerator = 0.0;
  double denominator = 0.0;
  for (int i = 0; i < 2; ++i) {
    if (!(weight[i] > 0.0)) continue;
    const double slope = ray_projector[i] - normalized[i] * ray_projector.z();
    const double right = normalized[i] * t.z() - t[i];
    numerator += weight[i] * slope * right;
    denominator += weight[i] * slope * slope;
  }
  return numerator / denominator;
}

RayPoint RaySolver::Solve(const Eigen::Vector2d& ray, const Observation& observation) const {
  RayPoint out;
  const Eigen::Vector3d ray_projector = R_projector_camera_ * ray.homogeneous();
  Eigen::Vector2d weight = Eigen::Vector2d::Zero();
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  for (int i = 0; i < 2; ++i) {
    if (!std::isfinite(observation.pixel[i]) || !(observation.sigma[i] > 0.0)) continue;
    pixel[i] = observation.pixel[i];
    weight[i] = 1.0 / (observation.sigma[i] * observation.sigma[i]);
  }
  double depth = ClosedForm(ray_projector, pixel, weight);
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
  Eigen::Vector2d residual = Eigen::Vector2d::Zero();
  double information = 0.0;
  for (int iteration = 0; iteration < kMaxIterations && !out.converged; ++iteration) {
    const Projection projection =
        ProjectWithJacobian(projector_, depth * ray_projector + t_projector_camera_);
    slope = projection.jacobian * ray_projector;
    residual = pixel - projection.pixel;
    information = slope.dot(weight.cwiseProduct(slope));
    const double step = slope.dot(weight.cwiseProduct(residual)) / information;
    // NaN: behind the projector, or a ray through its centre, where depth has no information.
    if (!std::isfinite(step)) return out;
    depth += step;
    out.converged = std::abs(step) <= kRelativeStep * std::abs(depth);
  }
  out.depth_m = depth;
  out.sigma_depth_m = 1.0 / std::sqrt(information);
  out.epipolar_px = out.sigma_epipolar_px = std::numeric_limits<double>::quiet_NaN();
  if (weight.minCoeff() > 0.0) {
    const Eigen::Vector2d normal = Eigen::Vector2d(-slope.y(), slope.x()).normalized();
    out.epipolar_px = normal.dot(residual);
    out.sigma_epipolar_px = normal.cwiseProduct(observation.sigma).norm();
  }
  return out;
}

}  // namespace fringe_fusion::triangulation
