#include "fringe_fusion/registration/doubled_surface.hpp"

#include <gtest/gtest.h>

#include <random>

namespace fringe_fusion {
namespace {

std::vector<float> Mixture(double distance_m, double share, double sigma_m, int count) {
  std::mt19937 random(7);
  std::normal_distribution<double> gauss(0.0, sigma_m);
  std::vector<float> residuals;
  for (int i = 0; i < count; ++i) {
    const double layer = i < share * count ? distance_m : 0.0;
    residuals.push_back(static_cast<float>(layer + gauss(random)));
  }
  return residuals;
}

TEST(FindDoubledSurface, MeasuresTheDistanceAndTheShareOfTwoLayers) {
  for (const double share : {0.5, 0.2}) {
    const auto doubled = FindDoubledSurface(Mixture(4e-4, share, 5e-5, 2000), 5e-5);
    ASSERT_TRUE(doubled) << share;
    EXPECT_NEAR(doubled->distance_m, 4e-4, 1e-5);
    EXPECT_NEAR(doubled->share, share, 0.02);
  }
}

TEST(FindDoubledSurface, OneLayerIsNotDoubled) {
  EXPECT_FALSE(FindDoubledSurface(Mixture(0.0, 0.5, 5e-5, 2000), 5e-5));
  EXPECT_FALSE(FindDoubledSurface(Mixture(0.0, 0.5, 5e-5, 2000), 0.0));
  // A wide tail around a narrow peak is one layer, too.
  std::vector<float> tailed = Mixture(0.0, 0.5, 5e-5, 2000);
  for (std::size_t i = 0; i < tailed.size(); i += 5) tailed[i] *= 6.0F;
  EXPECT_FALSE(FindDoubledSurface(tailed, 5e-5));
  // Skewed, but with one peak.
  std::vector<float> skewed = Mixture(0.0, 0.5, 5e-5, 2000);
  for (float& value : skewed) value = value > 0.0F ? 3.0F * value : value;
  EXPECT_FALSE(FindDoubledSurface(skewed, 5e-5));
}

TEST(FindDoubledSurface, LayersWithinTheNoiseAndFewPointsDoNotCount) {
  EXPECT_FALSE(FindDoubledSurface(Mixture(4e-4, 0.5, 5e-5, 2000), 2e-4));  // two sigma
  EXPECT_FALSE(FindDoubledSurface(Mixture(4e-4, 0.02, 5e-5, 2000), 5e-5));
  EXPECT_FALSE(FindDoubledSurface(Mixture(4e-4, 0.5, 5e-5, 99), 5e-5));
  EXPECT_FALSE(FindDoubledSurface({}, 5e-5));
  EXPECT_FALSE(FindDoubledSurface(std::vector<float>(500, 1e-4F), 5e-5));
}

}  // namespace
}  // namespace fringe_fusion
