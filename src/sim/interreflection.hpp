#pragma once

#include <array>
#include <vector>

#include "optics.hpp"
#include "view_samples.hpp"

namespace fringe_fusion::sim {

/// One diffuse bounce: light that reaches the surface seen by a camera pixel from other lit
/// surfaces. Receivers on a coarse grid of pixels, and every pixel that the grid does not
/// represent, gather over fixed directions; which surfaces they meet is kept for all pictures.
class Interreflection {
 public:
  Interreflection() = default;  ///< no light
  Interreflection(const RayScene& scene, const Shader& shader, const ViewSamples& view,
                  const Image<Eigen::Vector2d>& rays, const Transform& T_object_camera);

  /// Adds the reflected bounce of one picture, albedo times gathered light, to the pixels' light.
  /// @return irradiance per pixel, 1 as under a white projector; empty when constructed empty.
  [[nodiscard]] Image<float> Irradiance(const ProjectedLight& light, float max_defocus_px2) const;

 private:
  struct Emitter {
    float u = 0.0F;
    float v = 0.0F;
    float weight = 0.0F;  ///< diffuse radiance per unit of projected light, over all directions
    float defocus_px2 = 0.0F;
  };
  /// Up to four receivers and their shares.
  struct Blend {
    std::array<std::int32_t, 4> receiver{};
    std::array<float, 4> share{};
  };
  struct Receiver {
    RayHit hit;
    std::vector<Emitter> emitters;
  };

  void MakeReceivers(const Image<RayHit>& hits);
  void Gather(const RayScene& scene, const Shader& shader, Receiver& receiver, int index) const;
  [[nodiscard]] bool BlendGrid(const RayHit& hit, int x, int y, Blend& blend) const;

  int grid_width_ = 0;
  int grid_height_ = 0;
  std::vector<Receiver> receivers_;
  Image<Blend> blends_;
};

}  // namespace fringe_fusion::sim
