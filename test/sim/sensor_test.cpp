#include "src/sim/sensor.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::sim {
namespace {

constexpr int kSide = 400;

struct Moments {
  double mean = 0.0;
  double variance = 0.0;
};

Moments MomentsOf(const FramePixels& pixels) {
  return std::visit(
      [](const auto& image) {
        Moments m;
        for (const auto value : image) m.mean += static_cast<double>(value);
        m.mean /= static_cast<double>(image.size());
        for (const auto value : image)
          m.variance += std::pow(static_cast<double>(value) - m.mean, 2);
        m.variance /= static_cast<double>(image.size() - 1);
        return m;
      },
      pixels);
}

FramePixels ExposeFlat(const SimConfig& config, double radiance, int frame = 0) {
  return Expose(config, Image<float>(kSide, kSide, static_cast<float>(radiance)), 1.0,
                RandomStream(RandomUse::kPixelNoise, {config.seed, 0, frame}));
}

TEST(Sensor, NoiseVarianceFollowsTheModel) {
  for (const int bits : {8, 12}) {
    SimConfig config;
    config.bit_depth = bits;
    config.gain_dn = bits == 8 ? 0.08 : 0.9;
    config.read_noise_dn = bits == 8 ? 1.5 : 6.0;
    for (const double radiance : {0.1, 0.5, 0.9}) {
      const double dn = radiance * config.white_level_ratio * ((1 << bits) - 1);
      const Moments m = MomentsOf(ExposeFlat(config, radiance));
      const double variance =
          config.gain_dn * dn + config.read_noise_dn * config.read_noise_dn + 1.0 / 12.0;
      // The sample variance of n values scatters by sqrt(2 / n); four of those.
      const double scatter = 4.0 * std::sqrt(2.0) / kSide;
      EXPECT_NEAR(m.variance / variance, 1.0, scatter) << bits << " bit at " << radiance;
      EXPECT_NEAR(m.mean, dn, 4.0 * std::sqrt(variance) / kSide);
    }
  }
}

TEST(Sensor, EachNoiseIsOffAtZero) {
  SimConfig config;
  EXPECT_EQ(MomentsOf(ExposeFlat(config, 0.5)).variance, 0.0);
  EXPECT_EQ(MomentsOf(ExposeFlat(config, 0.5)).mean, std::round(0.5 * 0.8 * 255.0));
  config.gain_dn = 0.5;
  EXPECT_EQ(MomentsOf(ExposeFlat(config, 0.0)).variance, 0.0);  // no light, no shot noise
  EXPECT_GT(MomentsOf(ExposeFlat(config, 0.5)).variance, 20.0);
}

TEST(Sensor, QuantisesAndSaturates) {
  SimConfig config;
  EXPECT_EQ(std::get<Image<std::uint8_t>>(ExposeFlat(config, 5.0))(3, 4), 255);
  config.bit_depth = 12;
  EXPECT_EQ(std::get<Image<std::uint16_t>>(ExposeFlat(config, 5.0))(3, 4), 4095);
  EXPECT_EQ(std::get<Image<std::uint16_t>>(ExposeFlat(config, 0.25))(3, 4), 819);
  config.read_noise_dn = 50.0;
  const FramePixels dark = ExposeFlat(config, 0.0);
  for (const std::uint16_t value : std::get<Image<std::uint16_t>>(dark)) ASSERT_LE(value, 4095);
  // Half of the values are cut at zero; the mean of the rest is sigma / sqrt(2 pi).
  EXPECT_NEAR(MomentsOf(dark).mean, 50.0 / std::sqrt(2.0 * 3.14159265), 0.4);
}

TEST(Sensor, ExposureScalesTheSignal) {
  const SimConfig config;
  const Image<float> radiance(2, 2, 0.5F);
  const RandomStream noise(RandomUse::kPixelNoise, {1});
  const FramePixels one = Expose(config, radiance, 1.0, noise);
  const FramePixels half = Expose(config, radiance, 0.5, noise);
  EXPECT_EQ(std::get<0>(one)(0, 0), 102);
  EXPECT_EQ(std::get<0>(half)(0, 0), 51);
}

TEST(Sensor, FramesAreIndependentAndRepeatable) {
  SimConfig config;
  config.bit_depth = 12;
  config.read_noise_dn = 20.0;
  const auto first = std::get<1>(ExposeFlat(config, 0.5, 1));
  const auto second = std::get<1>(ExposeFlat(config, 0.5, 2));
  const auto again = std::get<1>(ExposeFlat(config, 0.5, 1));
  EXPECT_TRUE(std::equal(first.begin(), first.end(), again.begin()));
  double product = 0.0;
  double neighbour = 0.0;
  const double mean = 0.5 * 0.8 * 4095.0;
  for (std::size_t i = 0; i + 1 < first.size(); ++i) {
    product += (first[i] - mean) * (second[i] - mean);
    neighbour += (first[i] - mean) * (first[i + 1] - mean);
  }
  const double scale = 400.0 * static_cast<double>(first.size());
  EXPECT_LT(std::abs(product / scale), 4.0 / kSide);
  EXPECT_LT(std::abs(neighbour / scale), 4.0 / kSide);
}

TEST(RandomStream, GaussianHasNormalMoments) {
  const RandomStream random(RandomUse::kPoseError, {5, 6});
  constexpr std::uint64_t kCount = 400000;
  std::array<double, 5> sums{};
  for (std::uint64_t i = 0; i < kCount; ++i) {
    const auto x = static_cast<double>(random.Gaussian(i));
    double power = 1.0;
    for (double& sum : sums) {
      sum += power;
      power *= x;
    }
  }
  const auto n = static_cast<double>(kCount);
  EXPECT_NEAR(sums[1] / n, 0.0, 4.0 / std::sqrt(n));
  EXPECT_NEAR(sums[2] / n, 1.0, 4.0 * std::sqrt(2.0 / n));
  EXPECT_NEAR(sums[3] / n, 0.0, 4.0 * std::sqrt(15.0 / n));
  EXPECT_NEAR(sums[4] / n, 3.0, 4.0 * std::sqrt(96.0 / n));
}

TEST(RandomStream, UniformFillsTheUnitInterval) {
  const RandomStream random(RandomUse::kFault, {1});
  std::array<int, 10> histogram{};
  for (std::uint64_t i = 0; i < 100000; ++i) {
    const double x = random.Uniform(i);
    ASSERT_GT(x, 0.0);
    ASSERT_LT(x, 1.0);
    ++histogram[static_cast<std::size_t>(10.0 * x)];
  }
  for (const int count : histogram) EXPECT_NEAR(count, 10000, 4 * 95);
}

}  // namespace
}  // namespace fringe_fusion::sim
