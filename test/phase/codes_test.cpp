// Every code of a PatternSequence, from rendered light to coordinates.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "fringe_fusion/phase/phase_map.hpp"
#include "synthetic_stack.hpp"

namespace fringe_fusion {
namespace {

using test::Synthesize;
using test::SyntheticScene;

struct Outcome {
  int num_valid = 0;
  int num_far = 0;  // more than half a projector pixel from the truth
  double rms_normalized = 0.0;
};

Outcome Judge(const Image<float>& value, const Image<float>& sigma,
              const std::function<double(int, int)>& truth) {
  Outcome out;
  for (int y = 0; y < value.height(); ++y) {
    for (int x = 0; x < value.width(); ++x) {
      if (!std::isfinite(value(x, y))) continue;
      const double error = static_cast<double>(value(x, y)) - truth(x, y);
      ++out.num_valid;
      if (std::abs(error) > 0.5) ++out.num_far;
      const double normalized = error / static_cast<double>(sigma(x, y));
      out.rms_normalized += normalized * normalized;
    }
  }
  out.rms_normalized = std::sqrt(out.rms_normalized / std::max(1, out.num_valid));
  return out;
}

SyntheticScene NoisyScene() {
  SyntheticScene scene;
  scene.width = 100;
  scene.height = 80;
  scene.read_noise_dn = 0.8;
  scene.gain_dn = 0.02;
  scene.u = [](int x, int y) { return 8.3 + 0.61 * x + 0.2 * y; };
  scene.v = [](int x, int y) { return 12.1 - 0.05 * x + 0.87 * y; };
  return scene;
}

PhaseMap Decode(const PatternConfig& pattern, const SyntheticScene& scene) {
  const auto sequence = MakeSequence(pattern, 128, 96);
  EXPECT_TRUE(sequence) << sequence.error().message;
  PhaseConfig config;
  config.read_noise_dn = scene.read_noise_dn;
  config.gain_dn = scene.gain_dn;
  ImageStack stack = Synthesize(*sequence, scene);
  // Frames may come in any order.
  std::reverse(stack.sequence.frames.begin(), stack.sequence.frames.end());
  std::reverse(stack.frames.begin(), stack.frames.end());
  for (std::size_t i = 0; i < stack.frames.size(); ++i) {
    stack.frames[i].stamp_ns = static_cast<std::int64_t>(i);
  }
  const auto map = DecodePhase(stack, config);
  EXPECT_TRUE(map) << map.error().message;
  return *map;
}

void ExpectDecodes(const PatternConfig& pattern, const SyntheticScene& scene,
                   const std::string& name) {
  const PhaseMap map = Decode(pattern, scene);
  for (const bool along_u : {true, false}) {
    const Outcome outcome =
        along_u ? Judge(map.u, map.sigma_u, scene.u) : Judge(map.v, map.sigma_v, scene.v);
    EXPECT_GT(outcome.num_valid, scene.width * scene.height * 98 / 100) << name;
    EXPECT_EQ(outcome.num_far, 0) << name;
    EXPECT_NEAR(outcome.rms_normalized, 1.0, 0.05) << name;
  }
  EXPECT_FALSE(map.relative_u || map.relative_v);
}

PatternConfig Fringes(const std::string& fringes, int steps) {
  PatternConfig config;
  config.fringes = fringes;
  config.steps = steps;
  return config;
}

TEST(Codes, Hierarchy) { ExpectDecodes(Fringes("1,4,16", 4), NoisyScene(), "1,4,16"); }

TEST(Codes, Heterodyne) {
  ExpectDecodes(Fringes("9,10", 4), NoisyScene(), "9,10");
  ExpectDecodes(Fringes("12,15,16", 3), NoisyScene(), "12,15,16");
}

TEST(Codes, CoprimePeriods) {
  PatternConfig config = Fringes("", 4);
  config.periods_px = "13,11";  // repeats after 143 of 128 px
  ExpectDecodes(config, NoisyScene(), "13,11 px");
}

TEST(Codes, ThreeToSixteenSteps) {
  for (const int steps : {3, 5, 7, 16}) {
    ExpectDecodes(Fringes("1,8", steps), NoisyScene(), std::to_string(steps));
  }
}

TEST(Codes, GrayHybrids) {
  PatternConfig config = Fringes("16", 4);
  config.gray = true;
  ExpectDecodes(config, NoisyScene(), "Gray with inverses");
  config.gray_inverse = false;
  ExpectDecodes(config, NoisyScene(), "Gray without inverses");
  config.gray_half_period = true;  // 4 px and 3 px cells under periods of 8 px and 6 px
  ExpectDecodes(config, NoisyScene(), "half-period Gray");
}

TEST(Codes, MicroPhaseShifting) {
  PatternConfig config;
  config.micro = true;
  config.fringes = "11,12,13,14,15,16,17";
  ExpectDecodes(config, NoisyScene(), "micro");
}

TEST(Codes, ModulatedUnderIndirectLight) {
  PatternConfig config = Fringes("1,8", 4);
  config.carrier_period_px = 10.0;
  SyntheticScene scene = NoisyScene();
  scene.indirect_dn = 60.0;
  ExpectDecodes(config, scene, "modulated");
}

TEST(Codes, SeveralExposures) {
  PatternConfig config = Fringes("1,8", 4);
  config.exposures = "0.25,1,4";
  // From dark to bright across the picture: no single exposure serves all of it.
  SyntheticScene scene = NoisyScene();
  ExpectDecodes(config, scene, "bright");
  scene.dark_dn = 2.0;
  scene.bright_dn = 20.0;
  ExpectDecodes(config, scene, "dark");
  scene.dark_dn = 60.0;
  scene.bright_dn = 800.0;  // only the shortest exposure stays below full scale
  ExpectDecodes(config, scene, "overexposed");
}

TEST(Codes, SingleFrequencyIsRelative) {
  SyntheticScene scene = NoisyScene();
  const PhaseMap map = Decode(Fringes("16", 4), scene);
  EXPECT_TRUE(map.relative_u && map.relative_v);
  // Right up to one multiple of the period of 8 px.
  const double shift = static_cast<double>(map.u(50, 40)) - scene.u(50, 40);
  EXPECT_NEAR(std::remainder(shift, 8.0), 0.0, 0.2);
  const Outcome outcome = Judge(map.u, map.sigma_u, [&](int x, int y) {
    return scene.u(x, y) + 8.0 * std::round(shift / 8.0);
  });
  EXPECT_GT(outcome.num_valid, scene.width * scene.height * 98 / 100);
  EXPECT_EQ(outcome.num_far, 0);
}

}  // namespace
}  // namespace fringe_fusion
