#include "src/sim/optics.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace fringe_fusion::sim {
namespace {

// Light of a small picture without stack of blurs.
ProjectedLight Light(const SimConfig& config, const Image<std::uint8_t>& picture) {
  return {config, picture, 0.0};
}

// Sum and variance along u of what one bright pixel in the dark becomes.
struct Spread {
  double sum = 0.0;
  double variance = 0.0;
};
Spread SpreadOfOnePixel(const SimConfig& config, double max_extra, float level) {
  Image<std::uint8_t> picture(61, 61);
  picture(30, 30) = 255;
  const ProjectedLight light(config, picture, max_extra);
  Spread spread;
  for (int v = 0; v < 61; ++v) {
    for (int u = 0; u < 61; ++u) {
      const auto value =
          static_cast<double>(light.Sample(static_cast<float>(u), static_cast<float>(v), level));
      spread.sum += value;
      spread.variance += value * (u - 30) * (u - 30);
    }
  }
  return spread;
}

TEST(Optics, NeutralLightIsLinear) {
  const SimConfig config;
  for (const int value : {0, 1, 100, 255}) {
    const Image<std::uint8_t> picture(8, 8, static_cast<std::uint8_t>(value));
    EXPECT_NEAR(Light(config, picture).Sample(3.3F, 4.2F, 0.0F), value / 255.0, 1e-6);
  }
}

TEST(Optics, GammaAndBlackLevel) {
  SimConfig config;
  config.projector_gamma = 2.2;
  config.projector_black_ratio = 0.03;
  const double middle = 0.03 + 0.97 * std::pow(128.0 / 255.0, 2.2);
  EXPECT_NEAR(Light(config, Image<std::uint8_t>(4, 4, 128)).Sample(1.0F, 1.0F, 0.0F), middle, 1e-6);
  EXPECT_NEAR(Light(config, Image<std::uint8_t>(4, 4, 0)).Sample(1.0F, 1.0F, 0.0F), 0.03, 1e-7);
  EXPECT_NEAR(Light(config, Image<std::uint8_t>(4, 4, 255)).Sample(1.0F, 1.0F, 0.0F), 1.0, 1e-6);
}

TEST(Optics, SamplesBilinearlyBetweenPixelCentres) {
  Image<std::uint8_t> picture(3, 2);
  picture(1, 0) = 255;
  picture(2, 1) = 51;
  const ProjectedLight light = Light(SimConfig{}, picture);
  EXPECT_FLOAT_EQ(light.Sample(1.0F, 0.0F, 0.0F), 1.0F);
  EXPECT_NEAR(light.Sample(0.75F, 0.0F, 0.0F), 0.75F, 1e-6F);
  EXPECT_NEAR(light.Sample(1.0F, 0.4F, 0.0F), 0.6F, 1e-6F);
  EXPECT_NEAR(light.Sample(1.5F, 0.5F, 0.0F), 0.25F * (1.0F + 0.2F), 1e-6F);
  EXPECT_NEAR(light.Sample(2.4F, 1.4F, 0.0F), 0.2F, 1e-6F);  // the outer half of the last pixel
}

TEST(Optics, BlurHasItsSigmaAndKeepsTheLight) {
  SimConfig config;
  config.projector_blur_px = 2.0;
  const Spread spread = SpreadOfOnePixel(config, 0.0, 0.0F);
  EXPECT_NEAR(spread.sum, 1.0, 1e-4);
  EXPECT_NEAR(spread.variance, 4.0, 0.02);
}

TEST(Optics, DefocusVarianceAddsToTheBlur) {
  SimConfig config;
  config.projector_blur_px = 1.0;
  constexpr double kMax = 9.0;
  for (const double extra : {0.0, 2.5, 9.0}) {
    const Spread spread = SpreadOfOnePixel(config, kMax, ProjectedLight::Level(extra, kMax));
    EXPECT_NEAR(spread.sum, 1.0, 1e-3);
    EXPECT_NEAR(spread.variance, 1.0 + extra, 0.02 * (1.0 + extra));
  }
}

TEST(Optics, DefocusFollowsTheInverseDepth) {
  SimConfig config;
  EXPECT_EQ(DefocusVariance(config, 0.4), 0.0);
  config.projector_focus_m = 0.5;
  config.projector_defocus_px_m = 4.0;
  EXPECT_NEAR(DefocusVariance(config, 0.5), 0.0, 1e-12);
  EXPECT_NEAR(DefocusVariance(config, 0.4), std::pow(4.0 * 0.5, 2), 1e-9);
  EXPECT_EQ(DefocusVariance(config, -0.1), 0.0);
}

TEST(Optics, DarknessSurroundsTheProjectedPicture) {
  SimConfig config;
  config.projector_blur_px = 3.0;
  const ProjectedLight light = Light(config, Image<std::uint8_t>(64, 64, 255));
  EXPECT_NEAR(light.Sample(32.0F, 32.0F, 0.0F), 1.0F, 1e-4F);
  // Half of the Gaussian lies beyond the edge, half a pixel further than the centre.
  EXPECT_NEAR(light.Sample(0.0F, 32.0F, 0.0F), 0.5 * (1.0 + std::erf(0.5 / (3.0 * std::sqrt(2.0)))),
              5e-3);
}

TEST(Optics, ZeroSigmaChangesNothing) {
  Image<float> image(5, 5);
  image(2, 3) = 4.0F;
  const Image<float> same = GaussianBlur(image, 0.0, true);
  for (std::size_t i = 0; i < image.size(); ++i) EXPECT_EQ(same[i], image[i]);
}

}  // namespace
}  // namespace fringe_fusion::sim
