// The fast instruction set gives the bytes of the portable one, on every code.
#include "src/phase/kernels.hpp"

#include <gtest/gtest.h>

#include <cstring>

#include "row_fixture.hpp"
#include "src/phase/axis_decoder.hpp"

namespace fringe_fusion::decode {
namespace {

test::SyntheticScene NoisyScene() {
  test::SyntheticScene scene;
  scene.width = 203;  // no multiple of any vector
  scene.height = 4;
  scene.read_noise_dn = 3.0;
  scene.bright_dn = 246.0;  // some samples saturate
  scene.u = [](int x, int y) { return 3.0 + 0.6 * x + y; };
  return scene;
}

void ExpectSameRows(const PatternConfig& pattern) {
  const ImageStack stack = test::Synthesize(MakeSequence(pattern, 128, 96).value(), NoisyScene());
  PhaseConfig config;
  config.report_order_error = true;
  test::RowFixture portable(stack, config, PortableKernels());
  test::RowFixture best(stack, config, BestKernels());
  AxisDecoder slow(portable.plan.u, portable.context);
  AxisDecoder fast(best.plan.u, best.context);
  for (int y = 0; y < 4; ++y) {
    portable.rows.Load(y);
    best.rows.Load(y);
    const AxisRow& a = slow.Run(portable.rows);
    const AxisRow& b = fast.Run(best.rows);
    const auto same = [](const std::vector<float>& p, const std::vector<float>& q) {
      return std::memcmp(p.data(), q.data(), 203 * sizeof(float)) == 0;
    };
    EXPECT_TRUE(same(a.coordinate_px, b.coordinate_px));
    EXPECT_TRUE(same(a.variance_px2, b.variance_px2));
    EXPECT_TRUE(same(a.log_odds, b.log_odds));
    EXPECT_TRUE(same(a.offset_dn, b.offset_dn));
    EXPECT_TRUE(same(a.amplitude2_dn2, b.amplitude2_dn2));
    EXPECT_EQ(std::memcmp(a.status.data(), b.status.data(), 203 * sizeof(std::int32_t)), 0);
  }
}

TEST(Kernels, InstructionSetsGiveTheSameBytes) {
  PatternConfig config;
  for (const int steps : {3, 4, 5}) {
    config.steps = steps;
    config.fringes = "1,4,16";
    ExpectSameRows(config);
    config.fringes = "15,16";
    ExpectSameRows(config);
  }
  config.exposures = "1,3";
  config.gray = true;
  config.fringes = "8";
  ExpectSameRows(config);
}

TEST(Kernels, NamesTell) {
  EXPECT_STREQ(PortableKernels().name, "portable");
  EXPECT_NE(BestKernels().name, nullptr);
}

}  // namespace
}  // namespace fringe_fusion::decode
