#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <random>

#include "fringe_fusion/triangulation/range_image.hpp"

namespace fringe_fusion::test {

/// A converging scanner with lens distortion on both devices.
inline CellCalibration MakeScanner() {
  CellCalibration cell;
  cell.camera = {160, 120, 250.0, 252.0, 81.3, 58.7, {-0.12, 0.05, 0.001, -0.0007, 0.01}};
  cell.projector = {320, 200, 420.0, 425.0, 158.0, 190.0, {-0.05, 0.08, -0.002, 0.001, 0.0}};
  cell.T_projector_camera = Transform::Identity();
  cell.T_projector_camera.linear() =
      ExpRotation(Eigen::Vector3d(0.12, 0.4, 0.03));  // looks across at the object
  cell.T_projector_camera.translation() = Eigen::Vector3d(-0.2, -0.03, 0.04);
  return cell;
}

/// Depth along z of the surface on the camera ray (x, y, 1); NaN: nothing there.
using DepthOfRay = std::function<double(const Eigen::Vector2d& ray)>;

inline DepthOfRay PlaneDepth(const Eigen::Vector3d& unit_normal, double offset_m) {
  return [=](const Eigen::Vector2d& ray) { return offset_m / unit_normal.dot(ray.homogeneous()); };
}

struct AnalyticView {
  PhaseMap phase;
  Image<Eigen::Vector3d> points;  ///< truth, camera frame
};

/// Projects a known surface into both devices and adds Gaussian noise of sigma_px to u and v.
inline AnalyticView MakeView(const CellCalibration& cell, const DepthOfRay& depth_of_ray,
                             const Eigen::Vector2d& sigma_px, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> unit;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  AnalyticView view;
  PhaseMap& phase = view.phase;
  phase.width = cell.camera.width;
  phase.height = cell.camera.height;
  phase.u = phase.v = phase.sigma_u = phase.sigma_v = Image<float>(phase.width, phase.height, nan);
  phase.offset = phase.modulation = Image<float>(phase.width, phase.height, 100.0F);
  phase.mask = Image<std::uint8_t>(phase.width, phase.height,
                                   static_cast<std::uint8_t>(MaskReason::kTooDark));
  phase.color = Image<Rgb8>(phase.width, phase.height, Rgb8{10, 20, 30});
  view.points =
      Image<Eigen::Vector3d>(phase.width, phase.height,
                             Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  for (int y = 0; y < phase.height; ++y) {
    for (int x = 0; x < phase.width; ++x) {
      const Eigen::Vector2d ray = Undistort(cell.camera, Eigen::Vector2d(x, y));
      const Eigen::Vector3d point = depth_of_ray(ray) * ray.homogeneous();
      if (!point.allFinite()) continue;
      const Eigen::Vector2d pixel = Project(cell.projector, cell.T_projector_camera * point);
      view.points(x, y) = point;
      phase.u(x, y) = static_cast<float>(pixel.x() + sigma_px.x() * unit(engine));
      phase.v(x, y) = static_cast<float>(pixel.y() + sigma_px.y() * unit(engine));
      phase.sigma_u(x, y) = static_cast<float>(sigma_px.x());
      phase.sigma_v(x, y) = static_cast<float>(sigma_px.y());
      phase.mask(x, y) = 0;
    }
  }
  return view;
}

}  // namespace fringe_fusion::test
