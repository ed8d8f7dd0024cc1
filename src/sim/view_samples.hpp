#pragma once

#include <vector>

#include "shading.hpp"

namespace fringe_fusion::sim {

/// A camera pixel whose area sees more than one surface or shade: it averages several samples.
struct EdgePixel {
  std::int32_t pixel = 0;  ///< index, row major
  std::int32_t first = 0;  ///< of kEdgeSamples samples
};
constexpr int kEdgeSamples = 9;  ///< 3 x 3 over the pixel's area

/// All rays of the camera at one pose.
struct ViewSamples {
  Image<SurfaceSample> centers;  ///< through every pixel centre
  std::vector<EdgePixel> edges;
  std::vector<SurfaceSample> edge_samples;
  float max_defocus_px2 = 0.0F;
};

/// Undistorted normalised coordinates of every pixel centre; NaN where there is no inverse.
[[nodiscard]] Image<Eigen::Vector2d> PixelRays(const CameraModel& camera);

/// Hit of the ray through a normalised image coordinate; face -1 when it hits nothing.
[[nodiscard]] RayHit CastPixel(const RayScene& scene, const Transform& T_object_camera,
                               const Eigen::Vector2d& normalized);

/// Casts every pixel, and 3 x 3 rays where neighbours differ in surface, crease, shadow or albedo.
[[nodiscard]] ViewSamples CastView(const RayScene& scene, const Shader& shader,
                                   const CameraModel& camera, const Image<Eigen::Vector2d>& rays,
                                   const Transform& T_object_camera);

}  // namespace fringe_fusion::sim
