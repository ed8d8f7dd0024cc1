// The fast instruction set gives the bytes of the portable one, on every code.
#include "src/phase/kernels.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "row_fixture.hpp"
#include "src/phase/axis_decoder.hpp"
#include "src/phase/decode_with.hpp"

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

PhaseMap DecodeBy(const Kernels& kernels, const ImageStack& stack, const PhaseConfig& config) {
  return DecodeWith(kernels, stack, config, NoProgress, {}).value();
}

template <typename T>
bool SameBytes(const Image<T>& a, const Image<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

// Several stretches of a row, of which the last has no whole number of vectors.
ImageStack WideStack(int steps, int bit_depth, bool with_white) {
  test::SyntheticScene scene = NoisyScene();
  scene.width = 603;
  scene.bit_depth = bit_depth;
  scene.bright_dn = 200.0;
  scene.u = [](int x, int y) { return 3.0 + 0.2 * x + y; };
  ImageStack stack = test::Synthesize(test::MakeTestSequence(false, "1,4,16", steps), scene);
  if (with_white) return stack;
  stack.sequence.frames.erase(stack.sequence.frames.begin(), stack.sequence.frames.begin() + 2);
  stack.frames.erase(stack.frames.begin(), stack.frames.begin() + 2);
  return stack;
}

void ExpectSameMaps(const ImageStack& stack) {
  const PhaseMap a = DecodeBy(PortableKernels(), stack, {});
  const PhaseMap b = DecodeBy(BestKernels(), stack, {});
  EXPECT_TRUE(SameBytes(a.u, b.u));
  EXPECT_TRUE(SameBytes(a.v, b.v));
  EXPECT_TRUE(SameBytes(a.sigma_u, b.sigma_u));
  EXPECT_TRUE(SameBytes(a.sigma_v, b.sigma_v));
  EXPECT_TRUE(SameBytes(a.offset, b.offset));
  EXPECT_TRUE(SameBytes(a.modulation, b.modulation));
  EXPECT_TRUE(SameBytes(a.mask, b.mask));
  EXPECT_TRUE(SameBytes(a.color, b.color));
}

TEST(Kernels, InstructionSetsGiveTheSameMaps) {
  for (const int steps : {3, 4}) {
    for (const int bit_depth : {8, 12}) {
      for (const bool with_white : {false, true}) {
        ExpectSameMaps(WideStack(steps, bit_depth, with_white));
      }
    }
  }
}

// Asking for the probability of wrong orders takes the general decoder.
TEST(Kernels, LadderDecodesWhatTheGeneralDecoderDoes) {
  PhaseConfig general;
  general.report_order_error = true;
  for (const int steps : {3, 4}) {
    for (const int bit_depth : {8, 12}) {
      ImageStack stack = WideStack(steps, bit_depth, steps == 3);
      const PhaseMap slow = DecodeBy(BestKernels(), stack, general);
      const PhaseMap fast = DecodeBy(BestKernels(), stack, {});
      int num_valid = 0;
      for (std::size_t i = 0; i < slow.u.size(); ++i) {
        EXPECT_EQ(slow.mask[i], fast.mask[i]);
        EXPECT_NEAR(slow.modulation[i], fast.modulation[i], 1e-3);
        if (slow.mask[i] != 0 || fast.mask[i] != 0) continue;
        ++num_valid;
        EXPECT_NEAR(slow.u[i], fast.u[i], 1e-4);
        EXPECT_NEAR(slow.v[i], fast.v[i], 1e-4);
        EXPECT_NEAR(slow.sigma_u[i], fast.sigma_u[i], 1e-4F * slow.sigma_u[i]);
      }
      EXPECT_GT(num_valid, 603 * 4 / 2);
      EXPECT_TRUE(SameBytes(slow.color, fast.color));
    }
  }
}

// A stretch with a saturated pixel is decoded without the saturated step, its neighbours as ever.
TEST(Kernels, LadderLeavesSaturatedPixelsToTheGeneralDecoder) {
  ImageStack stack = WideStack(4, 8, false);
  const PhaseMap clean = DecodeBy(BestKernels(), stack, {});
  auto& frame = std::get<Image<std::uint8_t>>(stack.frames[9].pixels);
  frame(300, 2) = 255;
  const PhaseMap map = DecodeBy(BestKernels(), stack, {});
  PhaseConfig general;
  general.report_order_error = true;
  const PhaseMap expected = DecodeBy(BestKernels(), stack, general);
  ASSERT_EQ(clean.mask(300, 2), 0);
  ASSERT_EQ(expected.mask(300, 2), 0);
  EXPECT_EQ(map.mask(300, 2), 0);
  EXPECT_EQ(map.u(300, 2), expected.u(300, 2));
  EXPECT_EQ(map.sigma_u(300, 2), expected.sigma_u(300, 2));
  EXPECT_NEAR(map.u(301, 2), clean.u(301, 2), 1e-4F);
  EXPECT_EQ(map.u(10, 2), clean.u(10, 2));
}

TEST(Kernels, NamesTell) {
  EXPECT_STREQ(PortableKernels().name, "portable");
  EXPECT_NE(BestKernels().name, nullptr);
}

}  // namespace
}  // namespace fringe_fusion::decode
