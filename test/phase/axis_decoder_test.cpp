#include "src/phase/axis_decoder.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "synthetic_stack.hpp"

namespace fringe_fusion::decode {
namespace {

// Science 2.3: P = erfc(pi / (sqrt(2) sqrt(s^2 sigma_l^2 + sigma_h^2))) with s = f_h / f_l. The
// limit of the order error is opened, so that wrong orders come through and can be counted.
TEST(AxisDecoder, WrongOrdersAreAsFrequentAsTheFormulaSays) {
  test::SyntheticScene scene;
  scene.width = 400;
  scene.height = 100;
  scene.read_noise_dn = 4.2;
  scene.u = [](int x, int /*y*/) { return 5.0 + 0.29 * x; };
  const ImageStack stack = test::Synthesize(test::MakeTestSequence(false, "1,32", 3), scene);
  const DecodePlan plan = MakeDecodePlan(stack.sequence).value();
  PhaseConfig config;
  config.read_noise_dn = scene.read_noise_dn;
  config.max_order_error_ratio = 0.5;
  FrameRows rows(stack, plan);
  AxisDecoder decoder(plan.u, config, scene.width);
  int num_wrong = 0;
  for (int y = 0; y < scene.height; ++y) {
    rows.Load(y);
    decoder.Run(rows);
    for (int x = 0; x < scene.width; ++x) {
      const AxisPixel pixel = decoder.Decode(static_cast<std::size_t>(x), 255.0F);
      ASSERT_EQ(pixel.reason, MaskReason::kValid);
      // Fusion pulls the value towards the coarse set by its weight 1 / 1025 only.
      const double error = static_cast<double>(pixel.coordinate_px) - scene.u(x, y);
      if (std::abs(error) > 2.0) ++num_wrong;
    }
  }
  const double sigma_rad =
      std::sqrt(2.0 / 3.0 * (scene.read_noise_dn * scene.read_noise_dn + 1.0 / 12.0)) / 80.0;
  const double p = std::erfc(M_PI / (std::sqrt(2.0) * sigma_rad * std::sqrt(32.0 * 32.0 + 1.0)));
  const double expected = p * scene.width * scene.height;
  ASSERT_GT(expected, 100.0);
  EXPECT_NEAR(num_wrong, expected, 4.0 * std::sqrt(expected));
}

TEST(AxisDecoder, DoubtfulOrdersAreMasked) {
  const test::SyntheticScene scene;
  ImageStack stack = test::Synthesize(test::MakeTestSequence(false, "1,8", 4), scene);
  const DecodePlan plan = MakeDecodePlan(stack.sequence).value();
  // The fine set shows another place than the coarse one: 0.45 fringes apart.
  test::SyntheticScene other = scene;
  other.u = [&](int x, int y) { return scene.u(x, y) + 0.45 * 16.0; };
  const ImageStack shifted = test::Synthesize(stack.sequence, other);
  for (const int frame : plan.u.sets[1].frame_of_step) {
    const auto i = static_cast<std::size_t>(frame);
    stack.frames[i] = shifted.frames[i];
  }
  FrameRows rows(stack, plan);
  AxisDecoder decoder(plan.u, {}, scene.width);
  rows.Load(5);
  decoder.Run(rows);
  const AxisPixel pixel = decoder.Decode(20, 255.0F);
  EXPECT_EQ(pixel.reason, MaskReason::kDoubtfulOrder);
  EXPECT_TRUE(std::isnan(pixel.coordinate_px));
}

TEST(AxisDecoder, CodesBeyondTheProjectorAreOutside) {
  test::SyntheticScene scene;
  PatternSequence sequence = test::MakeTestSequence(true, "", 4);
  sequence.width = 100;  // seven bits reach 128
  const ImageStack stack = test::Synthesize(sequence, [&] {
    scene.u = [](int x, int /*y*/) { return 60.0 + x; };
    return scene;
  }());
  const DecodePlan plan = MakeDecodePlan(stack.sequence).value();
  FrameRows rows(stack, plan);
  AxisDecoder decoder(plan.u, {}, scene.width);
  rows.Load(0);
  decoder.Run(rows);
  EXPECT_EQ(decoder.Decode(39, 255.0F).reason, MaskReason::kValid);
  EXPECT_EQ(decoder.Decode(40, 255.0F).reason, MaskReason::kOutsideProjector);
}

}  // namespace
}  // namespace fringe_fusion::decode
