#include "src/phase/step_fit.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "synthetic_stack.hpp"

namespace fringe_fusion::decode {
namespace {

test::SyntheticScene WordScene() {
  test::SyntheticScene scene;
  scene.bit_depth = 16;
  scene.dark_dn = 5000.0;
  scene.bright_dn = 45000.0;
  return scene;
}

TEST(StepFit, RecoversPhaseOffsetAndModulation) {
  const test::SyntheticScene scene = WordScene();
  for (const int steps : {3, 4, 7}) {
    const ImageStack stack = test::Synthesize(test::MakeTestSequence(false, "1,8", steps), scene);
    const DecodePlan plan = MakeDecodePlan(stack.sequence).value();
    FrameRows rows(stack, plan);
    StepFit fit(plan.u.sets[1], rows.width());
    rows.Load(3);
    fit.Run(rows);
    for (std::size_t x = 0; x < 64; ++x) {
      const double truth = 2.0 * M_PI * 8.0 * (scene.u(static_cast<int>(x), 3) + 0.5) / 128.0;
      const double error = static_cast<double>(fit.phase_rad(x)) - truth;
      EXPECT_NEAR(std::remainder(error, 2.0 * M_PI), 0.0, 1e-4);
      EXPECT_NEAR(fit.offset_dn(x), 25000.0F, 2.0F);
      EXPECT_NEAR(fit.modulation_dn(x), 20000.0F, 2.0F);
      EXPECT_LT(fit.residual_dn2(x), 7.0F);
    }
  }
}

// With variance s^2 the sum of squared residuals has the mean (N - 3) s^2.
TEST(StepFit, ResidualMeasuresTheNoise) {
  test::SyntheticScene scene = WordScene();
  scene.width = 400;
  scene.read_noise_dn = 30.0;
  scene.u = [](int x, int /*y*/) { return 0.3 * x; };
  const ImageStack stack = test::Synthesize(test::MakeTestSequence(false, "1,8", 6), scene);
  const DecodePlan plan = MakeDecodePlan(stack.sequence).value();
  FrameRows rows(stack, plan);
  StepFit fit(plan.u.sets[1], rows.width());
  double sum = 0.0;
  for (int y = 0; y < scene.height; ++y) {
    rows.Load(y);
    fit.Run(rows);
    for (std::size_t x = 0; x < 400; ++x) sum += static_cast<double>(fit.residual_dn2(x));
  }
  EXPECT_NEAR(sum / (400.0 * scene.height) / (3.0 * 900.0), 1.0, 0.03);
}

TEST(StepFit, FlatLightHasNoModulation) {
  test::SyntheticScene scene = WordScene();
  scene.bright_dn = scene.dark_dn;
  const ImageStack stack = test::Synthesize(test::MakeTestSequence(false, "1,8", 4), scene);
  const DecodePlan plan = MakeDecodePlan(stack.sequence).value();
  FrameRows rows(stack, plan);
  StepFit fit(plan.u.sets[1], rows.width());
  rows.Load(0);
  fit.Run(rows);
  EXPECT_NEAR(fit.modulation_dn(10), 0.0F, 1e-2F);
  EXPECT_FLOAT_EQ(fit.peak_dn(10), 5000.0F);
}

}  // namespace
}  // namespace fringe_fusion::decode
