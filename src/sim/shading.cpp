#include "shading.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "fringe_fusion/geometry/camera_model.hpp"
#include "optics.hpp"

namespace fringe_fusion::sim {

Shader::Shader(const SimConfig& config, const CellCalibration& calibration, const RayScene& scene,
               const Transform& T_object_camera, const PrintTexture* texture)
    : config_(config),
      calibration_(calibration),
      scene_(scene),
      texture_(texture),
      R_object_camera_(T_object_camera.linear()),
      T_projector_object_(calibration.T_projector_camera * T_object_camera.inverse()),
      projector_object_(T_projector_object_.inverse().translation()),
      nominal_distance_m_(NominalDistance(calibration)) {}

SurfaceSample Shader::Shade(const RayHit& hit, const Eigen::Vector3d& observer,
                            bool with_lobe) const {
  const Eigen::Vector3d point_projector = T_projector_object_ * hit.point;
  const Eigen::Vector2d pixel = ProjectSafely(calibration_.projector, point_projector);
  const double albedo = Albedo(hit, observer);
  SurfaceSample sample;
  sample.u = static_cast<float>(pixel.x());
  sample.v = static_cast<float>(pixel.y());
  sample.albedo = static_cast<float>(albedo);
  sample.defocus_px2 = static_cast<float>(DefocusVariance(config_, point_projector.z()));
  sample.face = hit.face;

  const Eigen::Vector3d to_projector = projector_object_ - hit.point;
  const double distance_m = to_projector.norm();
  const double cosine = hit.normal.dot(to_projector) / distance_m;
  sample.lit = Covers(calibration_.projector, pixel) && cosine > 0.0 &&
               scene_.Sees(hit.point, hit.normal, projector_object_);
  if (!sample.lit) return sample;
  double reflected = cosine;
  if (with_lobe && config_.specular_ratio > 0.0) {
    const Eigen::Vector3d to_observer = (observer - hit.point).normalized();
    const Eigen::Vector3d half = (to_observer + to_projector / distance_m).normalized();
    const double lobe = std::pow(std::max(0.0, half.dot(hit.normal)), config_.specular_exponent);
    reflected += config_.specular_ratio * lobe;
  }
  const double falloff = nominal_distance_m_ / distance_m;
  sample.direct = static_cast<float>(albedo * reflected * falloff * falloff);
  return sample;
}

double Shader::Albedo(const RayHit& hit, const Eigen::Vector3d& observer) const {
  const double albedo = Checker(hit.point);
  if (texture_ == nullptr) return albedo;
  // Steps on the surface for a third of a pixel, the distance of the rays of an edge pixel: the
  // point moves along its plane when the ray turns.
  const Eigen::Vector3d ray = hit.point - observer;
  const double depth = ray.dot(R_object_camera_.col(2));
  const auto step = [&](int axis, double focal_px) -> Eigen::Vector3d {
    const Eigen::Vector3d turn = std::abs(depth) / (3.0 * focal_px) * R_object_camera_.col(axis);
    return turn - hit.normal.dot(turn) / hit.normal.dot(ray) * ray;
  };
  return albedo * texture_->Lightness(hit.point, step(0, calibration_.camera.fx),
                                      step(1, calibration_.camera.fy));
}

double Shader::Checker(const Eigen::Vector3d& point) const {
  if (!(config_.texture_contrast > 0.0)) return config_.albedo;
  // Shifted so that faces on round coordinates do not lie on the border of two cells.
  const Eigen::Vector3d cell =
      2.0 / config_.texture_period_m * point + Eigen::Vector3d(0.31, 0.37, 0.43);
  const double parity = std::floor(cell.x()) + std::floor(cell.y()) + std::floor(cell.z());
  const bool dark = std::fmod(std::abs(parity), 2.0) > 0.5;
  return config_.albedo * (dark ? 1.0 - config_.texture_contrast : 1.0);
}

double NominalDistance(const CellCalibration& calibration) {
  const Transform T_camera_projector = calibration.T_projector_camera.inverse();
  const Eigen::Vector3d origin = T_camera_projector.translation();
  const CameraModel& projector = calibration.projector;
  const Eigen::Vector2d middle = Undistort(
      projector, Eigen::Vector2d(0.5 * (projector.width - 1), 0.5 * (projector.height - 1)));
  const Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d ray =
      T_camera_projector.linear() * Eigen::Vector3d(middle.x(), middle.y(), 1.0).normalized();
  // Nearest points of two lines: s on the camera's axis, from the normal equations.
  const double cosine = axis.dot(ray);
  const double sine_squared = 1.0 - cosine * cosine;
  const double s = (axis - cosine * ray).dot(origin) / sine_squared;
  // Parallel or diverging axes meet nowhere in front: take a usual 2.5 baselines.
  if (!(sine_squared > 1e-6) || !(s > 0.0)) return 2.5 * origin.norm();
  return (s * axis - origin).norm();
}

Eigen::Vector2d ProjectSafely(const CameraModel& model, const Eigen::Vector3d& point_device) {
  Eigen::Vector2d pixel = Project(model, point_device);
  const Eigen::Vector2d back = Undistort(model, pixel);
  if (!((back - point_device.head<2>() / point_device.z()).norm() < 1e-6)) {
    pixel.setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  return pixel;
}

bool Covers(const CameraModel& model, const Eigen::Vector2d& pixel) {
  return pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() < model.width - 0.5 &&
         pixel.y() < model.height - 0.5;
}

}  // namespace fringe_fusion::sim
