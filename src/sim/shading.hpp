#pragma once

#include "fringe_fusion/sim/sim_cell.hpp"
#include "print_texture.hpp"
#include "ray_scene.hpp"

namespace fringe_fusion::sim {

/// What one ray of the camera needs to know to answer any projected picture.
struct SurfaceSample {
  float u = 0.0F;  ///< projector coordinate [px], NaN if the projector cannot see there
  float v = 0.0F;
  float direct = 0.0F;  ///< radiance per unit of projected light, 0 where not lit
  float albedo = 0.0F;
  float defocus_px2 = 0.0F;  ///< variance of the projector's defocus blur at this depth
  std::int32_t face = -1;    ///< -1: nothing hit
  bool lit = false;          ///< the projector covers the point and sees it
};

/// Light from the projector to a surface point and on to an observer, for one pose of the scanner.
class Shader {
 public:
  /// @param texture print on the object, or null.
  Shader(const SimConfig& config, const CellCalibration& calibration, const RayScene& scene,
         const Transform& T_object_camera, const PrintTexture* texture = nullptr);

  /// @param hit seen from `observer`, in `object`.
  /// @param with_lobe adds the specular lobe towards the observer.
  [[nodiscard]] SurfaceSample Shade(const RayHit& hit, const Eigen::Vector3d& observer,
                                    bool with_lobe) const;
  [[nodiscard]] const Eigen::Vector3d& projector_object() const { return projector_object_; }

 private:
  [[nodiscard]] double Albedo(const RayHit& hit, const Eigen::Vector3d& observer) const;
  [[nodiscard]] double Checker(const Eigen::Vector3d& point) const;

  const SimConfig& config_;
  const CellCalibration& calibration_;
  const RayScene& scene_;
  const PrintTexture* texture_;
  Eigen::Matrix3d R_object_camera_;
  Transform T_projector_object_;
  Eigen::Vector3d projector_object_;
  double nominal_distance_m_;
};

/// Distance from the projector at which a frontal surface counts as fully lit: to the point of the
/// camera's axis nearest to the ray of the projector's middle pixel.
[[nodiscard]] double NominalDistance(const CellCalibration& calibration);

/// Pixel of a point in the device's frame; NaN behind the device and where the distortion
/// polynomial has folded back, so that points far outside never come back into the picture.
[[nodiscard]] Eigen::Vector2d ProjectSafely(const CameraModel& model,
                                            const Eigen::Vector3d& point_device);

/// True when a pixel coordinate lies on the device's area of width x height pixels.
[[nodiscard]] bool Covers(const CameraModel& model, const Eigen::Vector2d& pixel);

}  // namespace fringe_fusion::sim
