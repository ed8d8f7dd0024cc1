#include "fringe_fusion/diagnosis/sensor_noise.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "fringe_fusion/io/config_yaml.hpp"
#include "test/diagnosis/scenes.hpp"

namespace fringe_fusion {
namespace {

struct NoiseCase {
  int bit_depth;
  double read_noise_dn;
  double gain_dn;
  int steps;
  double ambient_ratio;
  double gamma;
};

class SensorNoiseOf : public testing::TestWithParam<NoiseCase> {};

ImageStack NoisyStack(const NoiseCase& c, int seed) {
  sim::SimConfig config;
  config.seed = seed;
  config.bit_depth = c.bit_depth;
  config.read_noise_dn = c.read_noise_dn;
  config.gain_dn = c.gain_dn;
  config.ambient_ratio = c.ambient_ratio;
  config.projector_gamma = c.gamma;
  sim::SimCell cell = test::MakePartCell(config, 4, 1);
  return test::Capture(cell, test::MakePatterns(cell.calibration(), "1,6,32", c.steps));
}

TEST_P(SensorNoiseOf, IsTrueWithinItsSigma) {
  const NoiseCase c = GetParam();
  const Result<SensorNoise> noise = EstimateSensorNoise(NoisyStack(c, 11), {});
  ASSERT_TRUE(noise) << noise.error().message;
  EXPECT_LT(std::abs(noise->gain_dn - c.gain_dn), 3.5 * noise->sigma_gain_dn)
      << noise->gain_dn << " +- " << noise->sigma_gain_dn;
  EXPECT_LT(std::abs(noise->read_noise_dn - c.read_noise_dn), 3.5 * noise->sigma_read_noise_dn)
      << noise->read_noise_dn << " +- " << noise->sigma_read_noise_dn;
  EXPECT_DOUBLE_EQ(noise->quantisation_dn, std::sqrt(1.0 / 12.0));
  if (c.ambient_ratio < 0.02) return;  // grey values near 0 are cut off: little is left to measure
  // A statement, not an excuse: the noise at a usual grey value is known to a few per cent.
  const double level = 0.3 * ((1 << c.bit_depth) - 1);
  const double truth = c.read_noise_dn * c.read_noise_dn + c.gain_dn * level;
  EXPECT_LT(noise->sigma_gain_dn * level, 0.1 * truth);
}

INSTANTIATE_TEST_SUITE_P(
    Cameras, SensorNoiseOf,
    testing::Values(NoiseCase{8, 1.0, 0.05, 4, 0.1, 1.0}, NoiseCase{8, 0.6, 0.02, 4, 0.05, 1.0},
                    NoiseCase{8, 1.5, 0.15, 6, 0.0, 1.0}, NoiseCase{12, 4.0, 0.5, 4, 0.05, 1.0},
                    NoiseCase{12, 8.0, 1.5, 5, 0.1, 1.8}, NoiseCase{12, 6.0, 1.0, 3, 0.1, 1.0}));

TEST(SensorNoise, GivesTheDecoderItsSettingsOnRequestOnly) {
  const ImageStack stack = NoisyStack({8, 2.0, 0.1, 4, 0.1, 1.0}, 3);
  DiagnosisConfig config;
  const auto as_is = WithSensorNoise(PhaseConfig{}, stack, config);
  ASSERT_TRUE(as_is);
  EXPECT_EQ(as_is->read_noise_dn, PhaseConfig{}.read_noise_dn);
  config.estimate_noise = true;
  const auto estimated = WithSensorNoise(PhaseConfig{}, stack, config);
  ASSERT_TRUE(estimated) << estimated.error().message;
  EXPECT_NEAR(estimated->read_noise_dn, 2.0, 0.3);
  EXPECT_NEAR(estimated->gain_dn, 0.1, 0.02);
}

// Spread of (u - truth) / sigma_u over the valid pixels, from its median absolute value.
double NormalisedError(const ImageStack& stack, const PhaseConfig& phase_config,
                       const DiagnosisConfig& config, const Image<float>& truth_u) {
  const auto with_noise = WithSensorNoise(phase_config, stack, config);
  EXPECT_TRUE(with_noise) << with_noise.error().message;
  const auto phase = DecodePhase(stack, *with_noise);
  EXPECT_TRUE(phase) << phase.error().message;
  std::vector<double> z;
  for (std::size_t i = 0; i < truth_u.size(); ++i) {
    if (phase->mask[i] != 0) continue;
    z.push_back(std::abs(static_cast<double>((phase->u[i] - truth_u[i]) / phase->sigma_u[i])));
  }
  EXPECT_GT(z.size(), 2000U);
  std::nth_element(z.begin(), z.begin() + static_cast<std::ptrdiff_t>(z.size() / 2), z.end());
  return z[z.size() / 2] / 0.6745;
}

TEST(SensorNoise, KeepsSigmaTrueWhereTheSettingsStateAnotherNoise) {
  sim::SimConfig config;
  config.seed = 21;
  config.read_noise_dn = 2.5;  // phase.yaml states 1.0 and 0.05
  config.gain_dn = 0.2;
  config.ambient_ratio = 0.1;
  sim::SimCell cell = test::MakePartCell(config, 4, 1);
  const ImageStack stack = test::Capture(cell, test::MakePatterns(cell.calibration(), "1,6,32", 4));
  const Image<float> truth_u = cell.Truth().u;
  DiagnosisConfig diagnosis;
  PhaseConfig phase;
  EXPECT_GT(NormalisedError(stack, phase, diagnosis, truth_u), 1.5);
  diagnosis.estimate_noise = true;
  const double estimated = NormalisedError(stack, phase, diagnosis, truth_u);
  // The camera's blur over a bent surface adds a little that is no noise.
  EXPECT_NEAR(estimated, 1.0, 0.1);
  diagnosis.estimate_noise = false;
  phase.read_noise_dn = config.read_noise_dn;
  phase.gain_dn = config.gain_dn;
  EXPECT_NEAR(estimated, NormalisedError(stack, phase, diagnosis, truth_u), 0.03);
}

TEST(SensorNoise, AStackThatSaysNothingAsksForTheSettings) {
  DiagnosisConfig diagnosis;
  diagnosis.estimate_noise = true;
  const auto refused = WithSensorNoise(PhaseConfig{}, ImageStack{}, diagnosis);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("set estimate_noise to false"), std::string::npos);
}

TEST(SensorNoise, CountsTheSpacingOfGreyValues) {
  // 12 bits in the upper bits of a 16-bit word.
  ImageStack stack = NoisyStack({12, 4.0, 0.5, 4, 0.05, 1.0}, 5);
  for (CapturedFrame& frame : stack.frames) {
    frame.bit_depth = 16;
    for (std::uint16_t& value : std::get<Image<std::uint16_t>>(frame.pixels)) {
      value = static_cast<std::uint16_t>(16 * value);
    }
  }
  const auto noise = EstimateSensorNoise(stack, {});
  ASSERT_TRUE(noise) << noise.error().message;
  EXPECT_DOUBLE_EQ(noise->quantisation_dn, 16.0 / std::sqrt(12.0));
  EXPECT_NEAR(noise->gain_dn, 16 * 0.5, 1.0);
}

TEST(SensorNoise, RefusesWhatSaysNothing) {
  const ImageStack stack = NoisyStack({8, 1.0, 0.05, 4, 0.0, 1.0}, 7);
  ImageStack dark = stack;
  for (CapturedFrame& frame : dark.frames) {
    for (std::uint8_t& value : std::get<Image<std::uint8_t>>(frame.pixels)) value = 0;
  }
  const auto of_dark = EstimateSensorNoise(dark, {});
  ASSERT_FALSE(of_dark);
  EXPECT_NE(of_dark.error().message.find("usable residuals"), std::string::npos);
  EXPECT_FALSE(EstimateSensorNoise(ImageStack{}, {}));
  DiagnosisConfig config;
  config.max_samples = -1;
  EXPECT_FALSE(EstimateSensorNoise(stack, config));
}

TEST(DiagnosisConfig, FileHasTheDefaults) {
  const auto loaded =
      LoadConfigFile<DiagnosisConfig>(std::string(SOURCE_DIR) + "/config/diagnosis.yaml");
  ASSERT_TRUE(loaded) << loaded.error().message;
  std::vector<std::string> from_file;
  std::vector<std::string> from_code;
  const auto write = [](std::vector<std::string>& list) {
    return [&list](const char* name, const auto& value, auto... /*bounds*/) {
      list.push_back(fmt::format("{} = {}", name, value));
    };
  };
  DiagnosisConfig file = *loaded;
  DiagnosisConfig code;
  file.Visit(write(from_file));
  code.Visit(write(from_code));
  EXPECT_EQ(from_file, from_code);
}

}  // namespace
}  // namespace fringe_fusion
