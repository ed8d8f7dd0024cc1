#include "sensor.hpp"

#include <algorithm>
#include <cmath>

#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::sim {
namespace {

template <typename T>
Image<T> Quantise(const SimConfig& config, const Image<float>& radiance, float dn_per_radiance,
                  const RandomStream& noise) {
  const auto full_scale = static_cast<float>((1 << config.bit_depth) - 1);
  const auto gain = static_cast<float>(config.gain_dn);
  const auto read_variance = static_cast<float>(config.read_noise_dn * config.read_noise_dn);
  const bool noisy = gain > 0.0F || read_variance > 0.0F;
  Image<T> pixels(radiance.width(), radiance.height());
  ParallelFor(radiance.height(), 16, [&](int begin, int end) {
    const auto width = static_cast<std::size_t>(radiance.width());
    for (std::size_t i = static_cast<std::size_t>(begin) * width;
         i < static_cast<std::size_t>(end) * width; ++i) {
      float dn = dn_per_radiance * radiance[i];
      // Photon counts of a lit pixel are large: the Poisson law is normal with variance gain * dn.
      if (noisy) dn += std::sqrt(gain * dn + read_variance) * noise.Gaussian(i);
      pixels[i] = static_cast<T>(std::clamp(dn, 0.0F, full_scale) + 0.5F);
    }
  });
  return pixels;
}

}  // namespace

FramePixels Expose(const SimConfig& config, const Image<float>& radiance, double exposure,
                   const RandomStream& noise) {
  const int full_scale = (1 << config.bit_depth) - 1;
  const auto scale = static_cast<float>(full_scale * config.white_level_ratio * exposure);
  if (config.bit_depth > 8) return Quantise<std::uint16_t>(config, radiance, scale, noise);
  return Quantise<std::uint8_t>(config, radiance, scale, noise);
}

}  // namespace fringe_fusion::sim
