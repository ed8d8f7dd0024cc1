#include "src/phase/step_fit.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <functional>

#include "row_fixture.hpp"

namespace fringe_fusion::decode {
namespace {

constexpr double kTwoPi = 6.28318530717958647692;

test::SyntheticScene WordScene() {
  test::SyntheticScene scene;
  scene.bit_depth = 16;
  scene.dark_dn = 5000.0;
  scene.bright_dn = 45000.0;
  return scene;
}

double PhaseError(const StepFit& fit, std::size_t x, double truth_px) {
  const double truth_cycles = fit.set().fringes * (truth_px + 0.5) / 128.0;
  return kTwoPi * std::remainder(static_cast<double>(fit.row().cycles[x]) - truth_cycles, 1.0);
}

TEST(StepFit, RecoversPhaseOffsetAndModulation) {
  const test::SyntheticScene scene = WordScene();
  for (const int steps : {3, 4, 7}) {
    test::RowFixture fixture(test::Synthesize(test::MakeTestSequence(false, "1,8", steps), scene));
    StepFit fit(fixture.plan.u.sets[1], fixture.context);
    fixture.rows.Load(3);
    fit.Run(fixture.rows);
    for (std::size_t x = 0; x < 64; ++x) {
      EXPECT_NEAR(PhaseError(fit, x, scene.u(static_cast<int>(x), 3)), 0.0, 1e-4);
      EXPECT_NEAR(fit.row().offset[x], 25000.0F, 2.0F);
      EXPECT_NEAR(std::sqrt(fit.row().amplitude2[x]), 20000.0F, 2.0F);
      EXPECT_EQ(fit.row().status[x], 0);
    }
  }
}

struct Spread {
  double rms_rad = 0.0;
  double rms_normalized = 0.0;
};

Spread MeasureSpread(test::RowFixture& fixture, const test::SyntheticScene& scene) {
  StepFit fit(fixture.plan.u.sets[1], fixture.context);
  Spread out;
  for (int y = 0; y < scene.height; ++y) {
    fixture.rows.Load(y);
    fit.Run(fixture.rows);
    for (std::size_t x = 0; x < static_cast<std::size_t>(scene.width); ++x) {
      const double error = PhaseError(fit, x, scene.u(static_cast<int>(x), y));
      const double variance = kTwoPi * kTwoPi * static_cast<double>(fit.row().variance[x]);
      out.rms_rad += error * error;
      out.rms_normalized += error * error / variance;
    }
  }
  const double count = static_cast<double>(scene.width) * scene.height;
  out.rms_rad = std::sqrt(out.rms_rad / count);
  out.rms_normalized = std::sqrt(out.rms_normalized / count);
  return out;
}

// Mean Cramer-Rao bound of the phase with A and B unknown, sigma^2 = floor + gain I.
double BoundRad(const test::SyntheticScene& scene, int steps) {
  const double a = 0.5 * (scene.bright_dn + scene.dark_dn);
  const double b = 0.5 * (scene.bright_dn - scene.dark_dn);
  double sum = 0.0;
  constexpr int kNumPhases = 72;
  for (int k = 0; k < kNumPhases; ++k) {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    for (int n = 0; n < steps; ++n) {
      const double phase =
          kTwoPi * (static_cast<double>(k) / kNumPhases - static_cast<double>(n) / steps);
      const double variance = scene.read_noise_dn * scene.read_noise_dn + 1.0 / 12.0 +
                              scene.gain_dn * (a + b * std::cos(phase));
      const Eigen::Vector3d row(1.0, std::cos(phase), -b * std::sin(phase));
      information += row * row.transpose() / variance;
    }
    sum += information.inverse()(2, 2) / kNumPhases;
  }
  return std::sqrt(sum);
}

// With shot noise the equal-weight fit misses the bound by 6 % and more; the weighted one does not.
TEST(StepFit, AttainsTheBoundOfShotNoise) {
  test::SyntheticScene scene;
  scene.width = 400;
  scene.height = 40;
  scene.dark_dn = 8.0;
  scene.bright_dn = 220.0;
  scene.read_noise_dn = 0.8;
  scene.gain_dn = 0.1;
  scene.u = [](int x, int y) { return 0.3 * x + 0.01 * y; };
  PhaseConfig config;
  config.read_noise_dn = scene.read_noise_dn;
  config.gain_dn = scene.gain_dn;
  for (const int steps : {3, 4, 5, 8}) {
    scene.seed = static_cast<unsigned>(steps);
    test::RowFixture fixture(test::Synthesize(test::MakeTestSequence(false, "1,8", steps), scene),
                             config);
    const Spread spread = MeasureSpread(fixture, scene);
    EXPECT_LT(spread.rms_rad / BoundRad(scene, steps), 1.03) << steps;
    EXPECT_NEAR(spread.rms_normalized, 1.0, 0.03) << steps;
  }
}

// Four times the exposure: most samples saturate, the rest still counts with its true noise.
TEST(StepFit, UsesAllExposuresWithoutSaturatedSamples) {
  test::SyntheticScene scene;
  scene.width = 300;
  scene.dark_dn = 10.0;
  scene.bright_dn = 110.0;
  scene.read_noise_dn = 1.0;
  scene.gain_dn = 0.05;
  scene.u = [](int x, int y) { return 0.3 * x + 0.01 * y; };
  PatternConfig pattern;
  pattern.fringes = "1,8";
  PhaseConfig config;
  config.read_noise_dn = scene.read_noise_dn;
  config.gain_dn = scene.gain_dn;
  double rms_alone = 0.0;
  for (const char* exposures : {"1", "1,4"}) {
    pattern.exposures = exposures;
    test::RowFixture fixture(test::Synthesize(MakeSequence(pattern, 128, 96).value(), scene),
                             config);
    const Spread spread = MeasureSpread(fixture, scene);
    EXPECT_NEAR(spread.rms_normalized, 1.0, 0.03) << exposures;
    if (rms_alone > 0.0) {
      EXPECT_LT(spread.rms_rad, 0.6 * rms_alone);
    }
    rms_alone = spread.rms_rad;
  }
}

TEST(StepFit, TakesUnevenSteps) {
  const test::SyntheticScene scene = WordScene();
  PatternSequence sequence = test::MakeTestSequence(false, "1,8", 4);
  for (Pattern& pattern : sequence.frames) pattern.phase_offset_rad = 0.15 * pattern.step;
  test::RowFixture fixture(test::Synthesize(sequence, scene));
  StepFit fit(fixture.plan.u.sets[1], fixture.context);
  fixture.rows.Load(3);
  fit.Run(fixture.rows);
  for (std::size_t x = 0; x < 64; ++x) {
    EXPECT_NEAR(PhaseError(fit, x, scene.u(static_cast<int>(x), 3)), 0.0, 1e-4);
  }
}

TEST(StepFit, NamesWhatIsWrong) {
  test::SyntheticScene scene = WordScene();
  scene.bright_dn = scene.dark_dn;
  const auto reason = [&](const test::SyntheticScene& of, int steps) {
    test::RowFixture fixture(test::Synthesize(test::MakeTestSequence(false, "1,8", steps), of));
    StepFit fit(fixture.plan.u.sets[1], fixture.context);
    fixture.rows.Load(0);
    fit.Run(fixture.rows);
    return fit.row().status[10];
  };
  for (const int steps : {3, 4, 5}) {
    EXPECT_EQ(reason(scene, steps), kRowLowModulation) << steps;
    test::SyntheticScene bright = WordScene();
    bright.dark_dn = bright.bright_dn = 1e6;
    EXPECT_EQ(reason(bright, steps), kRowSaturated) << steps;
  }
}

// One of four samples saturated: three remain and determine the phase.
TEST(StepFit, DropsOneSaturatedSample) {
  test::SyntheticScene scene = WordScene();
  scene.bright_dn = 70000.0;
  scene.u = [](int x, int /*y*/) { return 16.0 * (x / 8) - 0.5 + 0.2 * (x % 8); };
  test::RowFixture fixture(test::Synthesize(test::MakeTestSequence(false, "1,8", 4), scene));
  StepFit fit(fixture.plan.u.sets[1], fixture.context);
  fixture.rows.Load(0);
  fit.Run(fixture.rows);
  ASSERT_EQ(fit.row().status[0], 0);
  EXPECT_NEAR(PhaseError(fit, 0, scene.u(0, 0)), 0.0, 2e-4);
  EXPECT_NEAR(std::sqrt(fit.row().amplitude2[0]), 32500.0F, 5.0F);
}

// A carrier keeps only the direct light; the indirect light would shift nothing but B / A here.
TEST(StepFit, CarrierSeparatesDirectLight) {
  test::SyntheticScene scene = WordScene();
  scene.indirect_dn = 8000.0;
  PatternConfig pattern;
  pattern.fringes = "1,8";
  pattern.carrier_period_px = 12.0;
  test::RowFixture fixture(test::Synthesize(MakeSequence(pattern, 128, 96).value(), scene));
  StepFit fit(fixture.plan.u.sets[1], fixture.context);
  fixture.rows.Load(3);
  fit.Run(fixture.rows);
  for (std::size_t x = 0; x < 64; ++x) {
    EXPECT_NEAR(PhaseError(fit, x, scene.u(static_cast<int>(x), 3)), 0.0, 2e-4);
    // 40000 / 4: half of the light through the carrier, half of the rest in the fringe.
    EXPECT_NEAR(std::sqrt(fit.row().amplitude2[x]), 10000.0F, 3.0F);
    EXPECT_NEAR(fit.row().offset[x], 10000.0F, 3.0F);
  }
}

}  // namespace
}  // namespace fringe_fusion::decode
