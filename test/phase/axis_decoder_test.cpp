#include "src/phase/axis_decoder.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "row_fixture.hpp"

namespace fringe_fusion::decode {
namespace {

std::int32_t StatusAt(const AxisRow& row, std::size_t x) { return row.status[x]; }

// Science 2.3: P = erfc(pi / (sqrt(2) sqrt(s^2 sigma_l^2 + sigma_h^2))) with s = f_h / f_l. The
// limit of the order error is opened, so that wrong orders come through and can be counted.
TEST(AxisDecoder, WrongOrdersAreAsFrequentAsTheFormulaSays) {
  test::SyntheticScene scene;
  scene.width = 400;
  scene.height = 100;
  scene.read_noise_dn = 4.2;
  scene.u = [](int x, int /*y*/) { return 5.0 + 0.29 * x; };
  PhaseConfig config;
  config.read_noise_dn = scene.read_noise_dn;
  config.gain_dn = 0.0;
  config.max_order_error_ratio = 0.5;
  config.max_wrong_order_ratio = 1.0;
  config.max_level_sigma = 1e6;
  test::RowFixture fixture(test::Synthesize(test::MakeTestSequence(false, "1,32", 3), scene),
                           config);
  AxisDecoder decoder(fixture.plan.u, fixture.context);
  int num_wrong = 0;
  for (int y = 0; y < scene.height; ++y) {
    fixture.rows.Load(y);
    const AxisRow& row = decoder.Run(fixture.rows);
    for (std::size_t x = 0; x < static_cast<std::size_t>(scene.width); ++x) {
      ASSERT_EQ(row.status[x], 0);
      // Fusion pulls the value towards the coarse set by its weight 1 / 1025 only.
      const double truth = scene.u(static_cast<int>(x), y);
      if (std::abs(static_cast<double>(row.coordinate_px[x]) - truth) > 2.0) ++num_wrong;
    }
  }
  const double sigma_rad =
      std::sqrt(2.0 / 3.0 * (scene.read_noise_dn * scene.read_noise_dn + 1.0 / 12.0)) / 80.0;
  const double p = std::erfc(M_PI / (std::sqrt(2.0) * sigma_rad * std::sqrt(32.0 * 32.0 + 1.0)));
  const double expected = p * scene.width * scene.height;
  ASSERT_GT(expected, 100.0);
  EXPECT_NEAR(num_wrong, expected, 3.0 * std::sqrt(expected));
}

TEST(AxisDecoder, DoubtfulOrdersAreMasked) {
  const test::SyntheticScene scene;
  ImageStack stack = test::Synthesize(test::MakeTestSequence(false, "1,8", 4), scene);
  const DecodePlan plan = MakeDecodePlan(stack.sequence).value();
  // The fine set shows another place than the coarse one: 0.45 fringes apart.
  test::SyntheticScene other = scene;
  other.u = [&](int x, int y) { return scene.u(x, y) + 0.45 * 16.0; };
  const ImageStack shifted = test::Synthesize(stack.sequence, other);
  for (const PhaseSample& sample : plan.u.sets[1].samples) {
    const auto i = static_cast<std::size_t>(sample.frame);
    stack.frames[i] = shifted.frames[i];
  }
  test::RowFixture fixture(stack);
  AxisDecoder decoder(fixture.plan.u, fixture.context);
  fixture.rows.Load(5);
  EXPECT_EQ(StatusAt(decoder.Run(fixture.rows), 20), kRowDoubtfulOrder);
}

TEST(AxisDecoder, CodesBeyondTheProjectorAreOutside) {
  test::SyntheticScene scene;
  PatternSequence sequence = test::MakeTestSequence(true, "", 4);
  sequence.width = 100;  // seven bits reach 128
  const ImageStack stack = test::Synthesize(sequence, [&] {
    scene.u = [](int x, int /*y*/) { return 60.0 + x; };
    return scene;
  }());
  test::RowFixture fixture(stack);
  AxisDecoder decoder(fixture.plan.u, fixture.context);
  fixture.rows.Load(0);
  const AxisRow& row = decoder.Run(fixture.rows);
  EXPECT_EQ(StatusAt(row, 39), kRowValid);
  EXPECT_EQ(StatusAt(row, 40), kRowOutside);
}

}  // namespace
}  // namespace fringe_fusion::decode
