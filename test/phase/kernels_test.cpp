// The fast instruction set gives the bytes of the portable one, on every code.
#include "src/phase/kernels.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>

#include "row_fixture.hpp"
#include "src/phase/axis_decoder.hpp"
#include "src/phase/decode_with.hpp"

namespace fringe_fusion::decode {
namespace {

test::SyntheticScene KernelScene() {
  test::SyntheticScene scene;
  scene.width = 203;  // no multiple of any vector
  scene.height = 4;
  scene.read_noise_dn = 3.0;
  scene.bright_dn = 246.0;  // some samples saturate
  scene.u = [](int x, int y) { return 3.0 + 0.6 * x + y; };
  return scene;
}

void ExpectSameRows(const PatternConfig& pattern) {
  const ImageStack stack = test::Synthesize(MakeSequence(pattern, 128, 96).value(), KernelScene());
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
  if (a.size() != b.size()) return false;
  return a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

// Several stretches of a row, of which the last has no whole number of vectors.
ImageStack WideStack(int steps, int bit_depth, bool with_white) {
  test::SyntheticScene scene = KernelScene();
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

/// How far two decodings of one axis lie apart where both are valid, in sigma.
struct Distance {
  int num_valid = 0;
  int num_masks = 0;  ///< pixels with different masks
  double squares = 0.0;
  double sigma_ratio_off = 0.0;  ///< greatest

  [[nodiscard]] double Rms() const { return std::sqrt(squares / num_valid); }
};

Distance CompareMaps(const PhaseMap& a, const PhaseMap& b, bool axis_v) {
  const Image<float>& coordinate = axis_v ? a.v : a.u;
  const Image<float>& other = axis_v ? b.v : b.u;
  const Image<float>& sigma = axis_v ? a.sigma_v : a.sigma_u;
  const Image<float>& other_sigma = axis_v ? b.sigma_v : b.sigma_u;
  Distance distance;
  for (std::size_t i = 0; i < a.mask.size(); ++i) {
    if (a.mask[i] != b.mask[i]) ++distance.num_masks;
    if (a.mask[i] != 0 || b.mask[i] != 0) continue;
    ++distance.num_valid;
    const double off = static_cast<double>((coordinate[i] - other[i]) / sigma[i]);
    distance.squares += off * off;
    distance.sigma_ratio_off = std::max(
        distance.sigma_ratio_off, std::abs(static_cast<double>(other_sigma[i] / sigma[i]) - 1.0));
  }
  return distance;
}

// The quick kernels weigh coarse sets by B^2 alone, without the slant that shot noise gives the
// two parts of a phase: .12 sigma in the mean, which costs 0.7 % of the error.
void ExpectEquallyGood(const PhaseMap& slow, const PhaseMap& fast) {
  for (const bool axis_v : {false, true}) {
    if (axis_v && slow.v.empty()) continue;
    const Distance distance = CompareMaps(slow, fast, axis_v);
    EXPECT_GT(distance.num_valid, 100);
    EXPECT_LE(distance.Rms(), 0.15);
    EXPECT_LE(distance.sigma_ratio_off, 0.02);
    EXPECT_LE(distance.num_masks, static_cast<int>(slow.mask.size()) / 10000);
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
      ExpectEquallyGood(slow, fast);
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
  EXPECT_NEAR(map.u(301, 2), clean.u(301, 2), 0.5F * clean.sigma_u(301, 2));
  EXPECT_EQ(map.u(10, 2), clean.u(10, 2));
}

// Whole stretches, groups of pixels and single pixels without light, doubtful and bad ones: quick
// kernels leave them to the others, and nothing else changes.
ImageStack PatchyStack(const PatternSequence& sequence) {
  test::SyntheticScene scene = KernelScene();
  scene.width = 1100;
  scene.height = 40;
  scene.bright_dn = 180.0;
  scene.u = [](int x, int y) { return 1.0 + 0.11 * x + 0.05 * y; };
  scene.v = [](int x, int y) { return 3.0 + 0.02 * x + 2.0 * y; };
  ImageStack stack = test::Synthesize(sequence, scene);
  for (CapturedFrame& frame : stack.frames) {
    auto& image = std::get<Image<std::uint8_t>>(frame.pixels);
    for (int y = 0; y < scene.height; ++y) {
      for (int x = 0; x < scene.width; ++x) {
        const bool dark = (y > 6 && y < 24 && x < 530) || (x > 700 && x < 720) || x % 97 == 5;
        if (dark) image(x, y) = 7;
        if (y > 30 && x % 50 < 9) image(x, y) = static_cast<std::uint8_t>(60 + image(x, y) / 12);
      }
    }
  }
  auto& bad = std::get<Image<std::uint8_t>>(stack.frames[7].pixels);
  for (int x = 0; x < scene.width; x += 31) bad(x, 2) = static_cast<std::uint8_t>(bad(x, 2) ^ 64);
  return stack;
}

void ExpectQuickDecodesWhatTheGeneralDecoderDoes(const PatternSequence& sequence) {
  const ImageStack stack = PatchyStack(sequence);
  PhaseConfig general;
  general.report_order_error = true;
  ExpectSameMaps(stack);
  const PhaseMap slow = DecodeBy(BestKernels(), stack, general);
  const PhaseMap fast = DecodeBy(BestKernels(), stack, {});
  EXPECT_TRUE(SameBytes(slow.color, fast.color));
  ExpectEquallyGood(slow, fast);
  std::array<int, kNumMaskReasons> counts{};
  for (std::size_t i = 0; i < slow.mask.size(); ++i) {
    ++counts[slow.mask[i]];
    ASSERT_NEAR(slow.modulation[i], fast.modulation[i], 1e-3);
    ASSERT_NEAR(slow.offset[i], fast.offset[i], 1e-3);
  }
  EXPECT_GT(counts[0], 1100 * 15);
  EXPECT_GT(counts[1] + counts[8], 530 * 15);  // too dark, shadow
  EXPECT_GT(counts[2], 500);                   // low modulation
  EXPECT_GT(counts[5] + counts[6], 2);         // residual, doubtful order
}

TEST(Kernels, QuickOnesDecodeWhatTheGeneralDecoderDoes) {
  const PatternSequence two = test::MakeTestSequence(false, "1,4,16", 4);
  ExpectQuickDecodesWhatTheGeneralDecoderDoes(two);
  PatternSequence plain = two;
  plain.frames.erase(plain.frames.begin(), plain.frames.begin() + 2);
  ExpectQuickDecodesWhatTheGeneralDecoderDoes(plain);
  for (Pattern& pattern : plain.frames) pattern.phase_sign = -1.0;
  ExpectQuickDecodesWhatTheGeneralDecoderDoes(plain);
  for (Pattern& pattern : plain.frames) pattern.phase_offset_rad = 0.7;
  ExpectQuickDecodesWhatTheGeneralDecoderDoes(plain);
  PatternConfig one_axis;
  one_axis.axis_v = false;
  one_axis.fringes = "1,12";
  ExpectQuickDecodesWhatTheGeneralDecoderDoes(MakeSequence(one_axis, 128, 96).value());
}

TEST(Kernels, NamesTell) {
  EXPECT_STREQ(PortableKernels().name, "portable");
  EXPECT_NE(BestKernels().name, nullptr);
}

}  // namespace
}  // namespace fringe_fusion::decode
