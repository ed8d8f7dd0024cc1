#pragma once

#include <cstdint>

#include "fringe_fusion/common/image.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"

namespace fringe_fusion::sim {

/// Light that leaves the projector, 1 for a white pixel. With defocus it is a stack of pictures of
/// rising blur between which a surface point interpolates by its depth.
class ProjectedLight {
 public:
  /// @param max_extra_variance_px2 largest variance of the defocus blur in the scene; 0: no stack.
  ProjectedLight(const SimConfig& config, const Image<std::uint8_t>& picture,
                 double max_extra_variance_px2);

  /// Bilinear light at a projector coordinate; beyond the outer pixel centres the edge repeats.
  /// @param level blur level in [0, NumLevels() - 1], from Level.
  [[nodiscard]] float Sample(float u, float v, float level) const {
    const auto first = static_cast<int>(level);
    const float light = Bilinear(levels_[static_cast<std::size_t>(first)], u, v);
    const float part = level - static_cast<float>(first);
    if (part <= 0.0F) return light;
    const float next = Bilinear(levels_[static_cast<std::size_t>(first) + 1], u, v);
    return light + part * (next - light);
  }

  /// Blur level of a point with this much variance of defocus.
  [[nodiscard]] static float Level(double variance_px2, double max_extra_variance_px2);

 private:
  [[nodiscard]] static float Bilinear(const Image<float>& light, float u, float v);

  std::vector<Image<float>> levels_;
};

/// The picture as a panel of the same size shows it when one picture pixel covers `scale` panel
/// pixels from the upper left corner: what lies beyond is lost, what is missing is black.
[[nodiscard]] Image<std::uint8_t> ScalePicture(const Image<std::uint8_t>& picture, double scale);

/// Variance of the defocus blur at a depth in front of the projector [px^2].
[[nodiscard]] double DefocusVariance(const SimConfig& config, double depth_m);

/// Gaussian blur of an image; sigma 0 leaves it. Beyond the border `repeat_edge`, else darkness.
[[nodiscard]] Image<float> GaussianBlur(const Image<float>& image, double sigma_px,
                                        bool repeat_edge);

}  // namespace fringe_fusion::sim
