#include "src/phase/gray_fit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "row_fixture.hpp"

namespace fringe_fusion::decode {
namespace {

constexpr int kNumBits = 5;

// One row of 32 cells, pixel x on the middle of cell x; `contrast` of each bit and pixel.
ImageStack OneRow(bool with_inverse, const std::function<double(int bit, int x)>& contrast) {
  ImageStack stack;
  stack.sequence.width = 32;
  stack.sequence.height = 1;
  for (int bit = 0; bit < kNumBits; ++bit) {
    for (const bool inverse : {false, true}) {
      if (inverse && !with_inverse) continue;
      Pattern pattern;
      pattern.kind = PatternKind::kGray;
      pattern.bit = bit;
      pattern.inverse = inverse;
      stack.sequence.frames.push_back(pattern);
      Image<std::uint8_t> row(32, 1);
      for (int x = 0; x < 32; ++x) {
        const bool on = ((((x ^ (x >> 1)) >> bit) & 1) != 0) != inverse;
        row(x, 0) = static_cast<std::uint8_t>(100.0 + (on ? 50.0 : -50.0) * contrast(bit, x));
      }
      CapturedFrame frame;
      frame.pixels = row;
      stack.frames.push_back(frame);
    }
  }
  return stack;
}

std::vector<GrayInterval> Read(const ImageStack& stack, const PhaseConfig& config) {
  test::RowFixture fixture(stack, config);
  fixture.rows.Load(0);
  GrayFit fit(*fixture.plan.u.gray, fixture.context);
  fit.Run(fixture.rows);
  std::vector<GrayInterval> intervals;
  for (std::size_t x = 0; x < 32; ++x) intervals.push_back(fit.Cell(x));
  return intervals;
}

TEST(GrayFit, ReadsEveryCell) {
  for (const bool with_inverse : {true, false}) {
    const auto cells = Read(OneRow(with_inverse, [](int, int) { return 1.0; }), {});
    for (std::size_t x = 0; x < 32; ++x) {
      // Without inverses a cell that is dark or lit in every frame has no threshold.
      if (!with_inverse && (x == 0 || x == 21)) continue;
      EXPECT_DOUBLE_EQ(cells[x].centre_px, static_cast<double>(x));
      EXPECT_DOUBLE_EQ(cells[x].half_px, 0.5);
    }
  }
}

// Pixel 8 sits on the border of cells 7 and 8: bit 3 changes there, and only bit 3.
TEST(GrayFit, OneDoubtfulBitIsTheBorderOfTwoCells) {
  const auto cells =
      Read(OneRow(true, [](int bit, int x) { return bit == 3 && x == 8 ? 0.0 : 1.0; }), {});
  EXPECT_DOUBLE_EQ(cells[8].centre_px, 7.5);
  EXPECT_DOUBLE_EQ(cells[8].half_px, 0.5);
  EXPECT_DOUBLE_EQ(cells[9].centre_px, 9.0);
}

// A doubtful bit whose two readings are no neighbours has no answer.
TEST(GrayFit, AContradictionHasNoAnswer) {
  const auto cells =
      Read(OneRow(true, [](int bit, int x) { return bit == 4 && x == 5 ? 0.0 : 1.0; }), {});
  EXPECT_TRUE(std::isnan(cells[5].centre_px));
  EXPECT_DOUBLE_EQ(cells[6].centre_px, 6.0);
}

TEST(GrayFit, DoubtfulFinestBitsLeaveACoarserCell) {
  PhaseConfig config;
  config.num_fine_bits = 2;
  const auto blurred = [](int blurred_bits) {
    return [=](int bit, int /*x*/) { return bit < blurred_bits ? 0.0 : 1.0; };
  };
  const auto one = Read(OneRow(true, blurred(1)), config);
  EXPECT_DOUBLE_EQ(one[12].centre_px, 12.5);
  EXPECT_DOUBLE_EQ(one[13].centre_px, 12.5);
  EXPECT_DOUBLE_EQ(one[13].half_px, 1.0);
  const auto two = Read(OneRow(true, blurred(2)), config);
  EXPECT_DOUBLE_EQ(two[13].centre_px, 13.5);
  EXPECT_DOUBLE_EQ(two[13].half_px, 2.0);
  EXPECT_TRUE(std::isnan(Read(OneRow(true, blurred(3)), config)[13].centre_px));
}

// 3 sigma apart: enough where a misreading costs few cells, not for a gross error.
TEST(GrayFit, CostlyBitsNeedMore) {
  PhaseConfig config;
  config.read_noise_dn = 5.0;
  config.gain_dn = 0.0;
  const double sigma_dn = std::sqrt(2.0 * (25.0 + 1.0 / 12.0));
  const auto weak = [&](int weak_bit) {
    return [=](int bit, int /*x*/) { return bit == weak_bit ? 3.0 * sigma_dn / 100.0 : 1.0; };
  };
  EXPECT_DOUBLE_EQ(Read(OneRow(true, weak(0)), config)[13].centre_px, 13.0);
  EXPECT_TRUE(std::isnan(Read(OneRow(true, weak(4)), config)[13].centre_px));
  EXPECT_DOUBLE_EQ(Read(OneRow(true, weak(4)), config)[16].centre_px, 16.0);  // beside cell 15
}

// Fringes are unwrapped by certain bits only: a weak one means the border of the cells.
TEST(GrayFit, UnwrappingTrustsNoWeakBit) {
  PhaseConfig config;
  config.read_noise_dn = 5.0;
  const ImageStack stack =
      OneRow(true, [](int bit, int x) { return bit == 3 && x == 8 ? 0.2 : 1.0; });
  test::RowFixture fixture(stack, config);
  fixture.rows.Load(0);
  GrayFit fit(*fixture.plan.u.gray, fixture.context);
  fit.Run(fixture.rows);
  EXPECT_DOUBLE_EQ(fit.Cell(8).centre_px, 8.0);
  EXPECT_DOUBLE_EQ(fit.Interval(8).centre_px, 7.5);
}

}  // namespace
}  // namespace fringe_fusion::decode
