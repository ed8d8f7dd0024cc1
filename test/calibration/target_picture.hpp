#pragma once

#include <Eigen/LU>

#include "fringe_fusion/calibration/target_print.hpp"
#include "src/sim/optics.hpp"
#include "src/sim/print_texture.hpp"

namespace fringe_fusion::test_support {

/// Homography from the target's plane [m] to the pixels of a pinhole camera.
inline Eigen::Matrix3d TargetToPixel(int width, int height, double focal_px,
                                     const Transform& T_object_camera) {
  Eigen::Matrix3d K;
  K << focal_px, 0.0, 0.5 * width + 0.3, 0.0, focal_px, 0.5 * height - 0.2, 0.0, 0.0, 1.0;
  const Transform T_camera_target = T_object_camera.inverse();
  Eigen::Matrix3d plane;
  plane << T_camera_target.linear().leftCols<2>(), T_camera_target.translation();
  return K * plane;
}

/// A target as a pinhole camera sees it, 200 DN where it is white, 40 DN beside it.
inline Image<float> DrawTarget(const CalibrationTarget& target, const Eigen::Matrix3d& H, int width,
                               int height, bool is_mirrored = false, double blur_px = 0.6) {
  const TargetPrint print = MakeTargetPrint(target);
  // Soft edges: the blur of a lens comes before the pixels sample it, that of the picture after.
  const sim::PrintTexture texture(sim::SurfacePrint{print, Transform::Identity(), 2.5e-4});
  const Eigen::Matrix3d back = H.inverse();
  const double middle_twice = print.min_m.x() + print.max_m.x();
  const auto at = [&](double x, double y) -> Eigen::Vector3d {
    Eigen::Vector2d point = (back * Eigen::Vector3d(x, y, 1.0)).hnormalized();
    if (is_mirrored) point.x() = middle_twice - point.x();
    return {point.x(), point.y(), 0.0};
  };
  Image<float> picture(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Eigen::Vector3d point = at(x, y);
      const bool is_beside = (point.head<2>().array() < print.min_m.array()).any() ||
                             (point.head<2>().array() > print.max_m.array()).any();
      const double lightness =
          is_beside ? 0.2 : texture.Lightness(point, at(x + 1, y) - point, at(x, y + 1) - point);
      picture(x, y) = static_cast<float>(10.0 + 190.0 * lightness);
    }
  }
  return sim::GaussianBlur(picture, blur_px, true);
}

}  // namespace fringe_fusion::test_support
