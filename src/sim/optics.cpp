#include "optics.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::sim {
namespace {

constexpr int kDefocusLevels = 6;

Image<float> Radiance(const SimConfig& config, const Image<std::uint8_t>& picture) {
  std::array<float, 256> radiance{};
  const double black = config.projector_black_ratio;
  for (std::size_t value = 0; value < radiance.size(); ++value) {
    const double light = std::pow(static_cast<double>(value) / 255.0, config.projector_gamma);
    radiance[value] = static_cast<float>(black + (1.0 - black) * light);
  }
  Image<float> light(picture.width(), picture.height());
  ParallelFor(picture.height(), 64, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      std::transform(picture.row(y), picture.row(y) + picture.width(), light.row(y),
                     [&](std::uint8_t value) { return radiance[value]; });
    }
  });
  return light;
}

}  // namespace

ProjectedLight::ProjectedLight(const SimConfig& config, const Image<std::uint8_t>& picture,
                               double max_extra_variance_px2) {
  const Image<float> sharp = Radiance(config, picture);
  const double base = config.projector_blur_px * config.projector_blur_px;
  const int levels = max_extra_variance_px2 > 0.0 ? kDefocusLevels : 1;
  for (int i = 0; i < levels; ++i) {
    const double share = levels > 1 ? static_cast<double>(i) / (levels - 1) : 0.0;
    // No light comes from beyond the panel.
    levels_.push_back(GaussianBlur(sharp, std::sqrt(base + share * max_extra_variance_px2), false));
  }
}

float ProjectedLight::Level(double variance_px2, double max_extra_variance_px2) {
  if (!(max_extra_variance_px2 > 0.0)) return 0.0F;
  const double share = std::clamp(variance_px2 / max_extra_variance_px2, 0.0, 1.0);
  // A little less than the last level, so that there always is a next one.
  return static_cast<float>(share * (kDefocusLevels - 1) * (1.0 - 1e-6));
}

float ProjectedLight::Bilinear(const Image<float>& light, float u, float v) {
  const float x = std::clamp(u, 0.0F, static_cast<float>(light.width() - 1));
  const float y = std::clamp(v, 0.0F, static_cast<float>(light.height() - 1));
  const int x0 = static_cast<int>(x);
  const int y0 = static_cast<int>(y);
  const int x1 = std::min(x0 + 1, light.width() - 1);
  const float* upper = light.row(y0);
  const float* lower = light.row(std::min(y0 + 1, light.height() - 1));
  const float fx = x - static_cast<float>(x0);
  const float fy = y - static_cast<float>(y0);
  const float above = upper[x0] + fx * (upper[x1] - upper[x0]);
  const float below = lower[x0] + fx * (lower[x1] - lower[x0]);
  return above + fy * (below - above);
}

Image<std::uint8_t> ScalePicture(const Image<std::uint8_t>& picture, double scale) {
  if (scale == 1.0) return picture;
  Image<std::uint8_t> panel(picture.width(), picture.height());
  const cv::Mat in(picture.height(), picture.width(), CV_8U,
                   const_cast<std::uint8_t*>(picture.data()));
  cv::Mat out(picture.height(), picture.width(), CV_8U, panel.data());
  // Pixel centres: panel = scale (picture + 1/2) - 1/2.
  const double shift = 0.5 * scale - 0.5;
  const cv::Matx23d panel_picture(scale, 0.0, shift, 0.0, scale, shift);
  cv::warpAffine(in, out, panel_picture, out.size(), cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  return panel;
}

double DefocusVariance(const SimConfig& config, double depth_m) {
  if (!(config.projector_focus_m > 0.0) || !(depth_m > 0.0)) return 0.0;
  const double sigma_px =
      config.projector_defocus_px_m * std::abs(1.0 / depth_m - 1.0 / config.projector_focus_m);
  return sigma_px * sigma_px;
}

Image<float> GaussianBlur(const Image<float>& image, double sigma_px, bool repeat_edge) {
  if (!(sigma_px > 0.0) || image.empty()) return image;
  Image<float> blurred(image.width(), image.height());
  // OpenCV takes non-const pixels but only reads the first argument.
  const cv::Mat in(image.height(), image.width(), CV_32F, const_cast<float*>(image.data()));
  cv::Mat out(image.height(), image.width(), CV_32F, blurred.data());
  const int size = 2 * static_cast<int>(std::ceil(4.0 * sigma_px)) + 1;
  cv::GaussianBlur(in, out, cv::Size(size, size), sigma_px, sigma_px,
                   repeat_edge ? cv::BORDER_REPLICATE : cv::BORDER_CONSTANT);
  return blurred;
}

}  // namespace fringe_fusion::sim
