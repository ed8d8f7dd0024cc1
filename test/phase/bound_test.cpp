// Small Monte Carlo of accuracy, consistency and fringe orders.
#include <gtest/gtest.h>

#include <cmath>

#include "fringe_fusion/phase/phase_map.hpp"
#include "synthetic_stack.hpp"

namespace fringe_fusion {
namespace {

using test::Synthesize;
using test::SyntheticScene;

struct Tally {
  int count = 0;
  int num_wrong = 0;  // farther than half the finest period
  double squares = 0.0;
  double normalized = 0.0;
};

Tally Study(const std::string& fringes, int steps, const SyntheticScene& scene,
            const PhaseConfig& config) {
  PatternConfig pattern;
  pattern.fringes = fringes;
  pattern.steps = steps;
  pattern.axis_v = false;
  const auto sequence = MakeSequence(pattern, 1280, 800).value();
  const PhaseMap map = DecodePhase(Synthesize(sequence, scene), config).value();
  const double half_px = 0.5 * 1280.0 / sequence.frames.back().fringes;
  Tally tally;
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      if (map.mask(x, y) != 0) continue;
      const double error = static_cast<double>(map.u(x, y)) - scene.u(x, y);
      ++tally.count;
      if (std::abs(error) > half_px) {
        ++tally.num_wrong;
        continue;
      }
      tally.squares += error * error;
      tally.normalized += std::pow(error / static_cast<double>(map.sigma_u(x, y)), 2);
    }
  }
  return tally;
}

SyntheticScene WideScene(double read_noise_dn) {
  SyntheticScene scene;
  scene.width = 240;
  scene.height = 60;
  scene.read_noise_dn = read_noise_dn;
  scene.u = [](int x, int y) { return 60.0 + 4.7 * x + 0.31 * y; };
  return scene;
}

// Science 2.4: sigma_u = W / (2 pi) sigma_I / B sqrt(2 / sum N f^2).
TEST(Bound, IsAttainedByEveryNumberOfStepsAndSetOfFringes) {
  for (const auto& [fringes, sum_f2] :
       {std::pair<const char*, double>{"1,8,64", 1.0 + 64.0 + 4096.0},
        {"1,4,16,64", 1.0 + 16.0 + 256.0 + 4096.0},
        {"59,63,64", 59.0 * 59.0 + 63.0 * 63.0 + 4096.0}}) {
    for (const int steps : {3, 4, 5, 8, 16}) {
      const SyntheticScene scene = WideScene(0.9);
      PhaseConfig config;
      config.read_noise_dn = 0.9;
      config.gain_dn = 0.0;
      const Tally tally = Study(fringes, steps, scene, config);
      const double sigma_dn = std::sqrt(0.81 + 1.0 / 12.0);
      const double bound_px =
          1280.0 / (2.0 * M_PI) * sigma_dn / 80.0 * std::sqrt(2.0 / (steps * sum_f2));
      EXPECT_GT(tally.count, 240 * 60 * 97 / 100) << fringes << ' ' << steps;
      EXPECT_EQ(tally.num_wrong, 0) << fringes << ' ' << steps;
      EXPECT_LT(std::sqrt(tally.squares / tally.count) / bound_px, 1.05) << fringes << ' ' << steps;
      EXPECT_NEAR(tally.normalized / tally.count, 1.0, 0.1) << fringes << ' ' << steps;
    }
  }
}

PhaseConfig WithoutDoubt(double read_noise_dn) {
  PhaseConfig config;
  config.read_noise_dn = read_noise_dn;
  config.gain_dn = 0.0;
  config.max_order_error_ratio = 0.5;
  config.max_wrong_order_ratio = 1.0;
  config.max_level_sigma = 1e6;
  config.min_modulation_sigma = 1.0;
  config.max_bend_px = 10000.0;
  return config;
}

// Science 2.3: heterodyne f, f - 1: P = erfc(pi / (sqrt 2 sigma sqrt(f^2 + (f - 1)^2))).
TEST(Bound, HeterodyneOrdersFailAsOftenAsTheFormulaSays) {
  const SyntheticScene scene = WideScene(5.0);
  const Tally tally = Study("15,16", 3, scene, WithoutDoubt(5.0));
  const double sigma_rad = std::sqrt(2.0 / 3.0 * (25.0 + 1.0 / 12.0)) / 80.0;
  const double p =
      std::erfc(M_PI / (std::sqrt(2.0) * sigma_rad * std::sqrt(16.0 * 16.0 + 15.0 * 15.0)));
  const double expected = p * tally.count;
  ASSERT_GT(expected, 50.0);
  EXPECT_NEAR(tally.num_wrong, expected, 3.0 * std::sqrt(expected));
}

// With the mask on, what is left has the orders that it claims.
TEST(Bound, DoubtfulOrdersAreMaskedNotGuessed) {
  PhaseConfig config;
  config.read_noise_dn = 4.0;
  config.gain_dn = 0.0;
  for (const char* fringes : {"1,16,64", "15,16", "1,20"}) {
    const Tally tally = Study(fringes, 3, WideScene(4.0), config);
    EXPECT_GT(tally.count, 240 * 60 / 20) << fringes;
    EXPECT_EQ(tally.num_wrong, 0) << fringes;
  }
}

}  // namespace
}  // namespace fringe_fusion
