#include "fringe_fusion/geometry/camera_model.hpp"

#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "common/constants.hpp"

namespace fringe_fusion {
namespace {

struct Distortion {
  Eigen::Vector2d point;
  Eigen::Matrix2d jacobian;
};

// Brown-Conrady and its derivative with respect to the undistorted point.
Distortion DistortWithJacobian(const std::array<double, 5>& k, const Eigen::Vector2d& n) {
  const double x = n.x();
  const double y = n.y();
  const double r2 = x * x + y * y;
  const double radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  const double radial_by_r2 = k[0] + r2 * (2.0 * k[1] + r2 * 3.0 * k[4]);
  Distortion out;
  out.point.x() = x * radial + 2.0 * k[2] * x * y + k[3] * (r2 + 2.0 * x * x);
  out.point.y() = y * radial + k[2] * (r2 + 2.0 * y * y) + 2.0 * k[3] * x * y;
  const double mixed = 2.0 * x * y * radial_by_r2 + 2.0 * k[2] * x + 2.0 * k[3] * y;
  out.jacobian(0, 0) = radial + 2.0 * x * x * radial_by_r2 + 2.0 * k[2] * y + 6.0 * k[3] * x;
  out.jacobian(0, 1) = mixed;
  out.jacobian(1, 0) = mixed;
  out.jacobian(1, 1) = radial + 2.0 * y * y * radial_by_r2 + 6.0 * k[2] * y + 2.0 * k[3] * x;
  return out;
}

}  // namespace

Status Validate(const CameraModel& model, const std::string& owner) {
  if (model.width < 1 || model.height < 1) {
    return Fail("{}: size {} x {} must be at least 1 x 1", owner, model.width, model.height);
  }
  if (!(model.fx > 0.0) || !(model.fy > 0.0) || !std::isfinite(model.fx + model.fy)) {
    return Fail("{}: focal lengths fx {} fy {} must be positive", owner, model.fx, model.fy);
  }
  if (!std::isfinite(model.cx) || !std::isfinite(model.cy)) {
    return Fail("{}: principal point cx {} cy {} must be finite", owner, model.cx, model.cy);
  }
  for (const double k : model.distortion) {
    if (!std::isfinite(k)) return Fail("{}: distortion coefficient {} must be finite", owner, k);
  }
  return {};
}

Eigen::Vector2d Distort(const CameraModel& model, const Eigen::Vector2d& normalized) {
  return DistortWithJacobian(model.distortion, normalized).point;
}

Eigen::Vector2d Project(const CameraModel& model, const Eigen::Vector3d& point_device) {
  return ProjectWithJacobian(model, point_device).pixel;
}

Projection ProjectWithJacobian(const CameraModel& model, const Eigen::Vector3d& point_device) {
  Projection out;
  const double z = point_device.z();
  if (!(z > 0.0)) {
    out.pixel.setConstant(kNan);
    out.jacobian.setConstant(kNan);
    return out;
  }
  const Eigen::Vector2d normalized = point_device.head<2>() / z;
  const Distortion distorted = DistortWithJacobian(model.distortion, normalized);
  out.pixel = Eigen::Vector2d(model.fx * distorted.point.x() + model.cx,
                              model.fy * distorted.point.y() + model.cy);
  Eigen::Matrix<double, 2, 3> normalized_by_point;
  normalized_by_point << 1.0 / z, 0.0, -normalized.x() / z, 0.0, 1.0 / z, -normalized.y() / z;
  const Eigen::Matrix<double, 2, 3> distorted_by_point = distorted.jacobian * normalized_by_point;
  out.jacobian.row(0) = model.fx * distorted_by_point.row(0);
  out.jacobian.row(1) = model.fy * distorted_by_point.row(1);
  return out;
}

Eigen::Vector2d Undistort(const CameraModel& model, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d target((pixel.x() - model.cx) / model.fx,
                               (pixel.y() - model.cy) / model.fy);
  Eigen::Vector2d normalized = target;
  for (int iteration = 0; iteration < 20; ++iteration) {
    const Distortion distorted = DistortWithJacobian(model.distortion, normalized);
    // Past the fold of the radial polynomial two points share one pixel: no inverse there.
    if (!(distorted.jacobian.determinant() > 1e-6)) break;
    const Eigen::Vector2d step = distorted.jacobian.inverse() * (target - distorted.point);
    normalized += step;
    if (step.squaredNorm() < 1e-24) return normalized;
  }
  return Eigen::Vector2d::Constant(kNan);
}

}  // namespace fringe_fusion
