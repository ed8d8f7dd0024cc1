#include "fringe_fusion/pattern/pattern_sequence.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "fringe_fusion/pattern/pattern_light.hpp"

namespace fringe_fusion {
namespace {

constexpr double kPi = 3.14159265358979323846;

Pattern Phase(Axis axis, double fringes, int step, int steps) {
  Pattern pattern;
  pattern.kind = PatternKind::kPhase;
  pattern.axis = axis;
  pattern.fringes = fringes;
  pattern.step = step;
  pattern.steps = steps;
  return pattern;
}

Pattern Gray(int bit, bool inverse) {
  Pattern pattern;
  pattern.kind = PatternKind::kGray;
  pattern.bit = bit;
  pattern.inverse = inverse;
  return pattern;
}

TEST(PatternSequence, DefaultHasWhiteBlackAndAllPhaseSets) {
  const Result<PatternSequence> sequence = MakeSequence(PatternConfig{}, 1280, 800);
  ASSERT_TRUE(sequence);
  ASSERT_EQ(sequence->frames.size(), 2U + 2U * 3U * 4U);
  EXPECT_EQ(sequence->frames[0].kind, PatternKind::kWhite);
  EXPECT_EQ(sequence->frames[1].kind, PatternKind::kBlack);
  EXPECT_EQ(PatternName(sequence->frames[2]), "phase_u_f1_0of4");
  EXPECT_EQ(PatternName(sequence->frames.back()), "phase_v_f64_3of4");
  EXPECT_TRUE(Validate(*sequence, "patterns.yaml"));
}

TEST(PatternSequence, GrayBitsCoverTheAxisWithInverses) {
  PatternConfig config;
  config.gray = true;
  config.fringes = "";
  config.axis_v = false;
  const Result<PatternSequence> sequence = MakeSequence(config, 1280, 800);
  ASSERT_TRUE(sequence);
  ASSERT_EQ(sequence->frames.size(), 2U + 2U * 11U);
  EXPECT_EQ(PatternName(sequence->frames[2]), "gray_u_b10");
  EXPECT_EQ(PatternName(sequence->frames[3]), "gray_u_b10_inv");
  EXPECT_EQ(PatternName(sequence->frames.back()), "gray_u_b0_inv");
}

TEST(PatternSequence, RefusesBadSettings) {
  PatternConfig config;
  for (const char* fringes : {"8,1", "a", "1,,8", "0", "1,nan", "1 2"}) {
    config.fringes = fringes;
    EXPECT_FALSE(MakeSequence(config, 64, 64)) << fringes;
  }
  config = PatternConfig{};
  config.steps = 2;
  EXPECT_FALSE(MakeSequence(config, 64, 64));
  config = PatternConfig{};
  config.axis_u = config.axis_v = false;
  EXPECT_FALSE(MakeSequence(config, 64, 64));
  config = PatternConfig{};
  config.fringes = "";
  EXPECT_FALSE(MakeSequence(config, 64, 64));
  EXPECT_FALSE(MakeSequence(PatternConfig{}, 0, 64));
}

TEST(PatternSequence, AFringeNeedsTwoPixels) {
  PatternConfig config;
  config.axis_v = false;
  config.fringes = "1,8,32";
  EXPECT_TRUE(MakeSequence(config, 64, 48));
  config.fringes = "1,8,33";
  const auto made = MakeSequence(config, 64, 48);
  ASSERT_FALSE(made);
  EXPECT_NE(made.error().message.find("fringes 33 is outside (0, 32]: a fringe needs 2 of the 64"),
            std::string::npos)
      << made.error().message;
  // The rows are fewer than the columns.
  config.axis_v = true;
  config.fringes = "1,8,32";
  const auto rows = MakeSequence(config, 64, 48);
  ASSERT_FALSE(rows);
  EXPECT_NE(rows.error().message.find("fringes 32 is outside (0, 24]"), std::string::npos);
}

TEST(PatternSequence, ValidateFindsIncompleteSets) {
  PatternSequence sequence;
  sequence.width = sequence.height = 64;
  EXPECT_FALSE(Validate(sequence, "patterns.yaml"));
  sequence.frames = {Phase(Axis::kU, 8.0, 0, 3), Phase(Axis::kU, 8.0, 1, 3)};
  const Status missing = Validate(sequence, "patterns.yaml");
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().message.find("8 fringes has 2 of 3 steps"), std::string::npos);
  sequence.frames.push_back(Phase(Axis::kU, 8.0, 2, 3));
  EXPECT_TRUE(Validate(sequence, "patterns.yaml"));
  sequence.frames.push_back(Phase(Axis::kU, 8.0, 2, 3));
  EXPECT_FALSE(Validate(sequence, "patterns.yaml"));
  sequence.frames = {Gray(0, false), Gray(2, false)};
  EXPECT_FALSE(Validate(sequence, "patterns.yaml"));
  sequence.frames = {Phase(Axis::kU, std::numeric_limits<double>::quiet_NaN(), 0, 3)};
  EXPECT_FALSE(Validate(sequence, "patterns.yaml"));
}

TEST(PatternSequence, HalfPeriodGrayCellsEndOnTheFringes) {
  PatternConfig config;
  config.gray = true;
  config.gray_inverse = false;
  config.gray_half_period = true;
  config.fringes = "25";
  const Result<PatternSequence> sequence = MakeSequence(config, 1280, 800);
  ASSERT_TRUE(sequence) << sequence.error().message;
  // 50 cells of 25.6 px need 6 bits.
  EXPECT_EQ(sequence->frames.size(), 2U + 2U * (6U + 4U));
  EXPECT_EQ(sequence->frames[2].bit, 5);
  EXPECT_DOUBLE_EQ(sequence->frames[2].cell_px, 25.6);
  EXPECT_DOUBLE_EQ(sequence->frames.back().fringes, 25.0);
}

TEST(PatternSequence, PeriodsBecomeFringesOfEachAxis) {
  PatternConfig config;
  config.periods_px = "19,17,13";
  const Result<PatternSequence> sequence = MakeSequence(config, 1280, 800);
  ASSERT_TRUE(sequence) << sequence.error().message;
  EXPECT_DOUBLE_EQ(sequence->frames[2].fringes, 1280.0 / 19.0);
  EXPECT_DOUBLE_EQ(sequence->frames.back().fringes, 800.0 / 13.0);
  config.periods_px = "13,17";
  EXPECT_FALSE(MakeSequence(config, 1280, 800));
}

TEST(PatternSequence, EveryExposureHasTheWholeCode) {
  PatternConfig config;
  config.fringes = "1,8";
  config.exposures = "1,4";
  const Result<PatternSequence> sequence = MakeSequence(config, 128, 96);
  ASSERT_TRUE(sequence) << sequence.error().message;
  EXPECT_EQ(sequence->frames.size(), 2U * (2U + 2U * 2U * 4U));
  EXPECT_EQ(PatternName(sequence->frames.back()), "phase_v_f8_3of4_e4");
}

TEST(PatternSequence, RefusesCodesThatRepeatWithinTheAxis) {
  const auto message = [](const std::string& fringes, const std::string& periods, bool micro) {
    PatternConfig config;
    config.fringes = fringes;
    config.periods_px = periods;
    config.micro = micro;
    const auto sequence = MakeSequence(config, 1280, 800);
    return sequence ? std::string() : sequence.error().message;
  };
  EXPECT_EQ(message("2,8", "", false),
            "pattern: axis u: the 2 frequencies repeat together after 640 of 1280 px");
  EXPECT_NE(message("", "20,16", false).find("repeat together after 80 of 1280 px"),
            std::string::npos);
  EXPECT_EQ(message("99,100", "", false), "");
  EXPECT_EQ(message("90,99,100", "", false), "");
  EXPECT_EQ(message("64", "", false), "");  // relative
  EXPECT_NE(message("16", "", true).find("needs at least 2 and 3"), std::string::npos);
  EXPECT_NE(message("16,18", "", true).find("repeat together after 640"), std::string::npos);
}

TEST(PatternSequence, RefusesWhatCannotBeShown) {
  const auto message = [](const std::function<void(Pattern&)>& change) {
    PatternSequence sequence;
    sequence.width = sequence.height = 64;
    for (int step = 0; step < 3; ++step) {
      sequence.frames.push_back(Phase(Axis::kU, 8.0, step, 3));
      change(sequence.frames.back());
    }
    const Status status = Validate(sequence, "p");
    return status ? std::string() : status.error().message;
  };
  EXPECT_EQ(message([](Pattern& p) { p.exposure_ratio = 0.0; }),
            "p: frame 0 (phase_u_f8_0of3_e0): exposure_ratio 0 is outside (0, 10000]");
  EXPECT_NE(message([](Pattern& p) { p.carrier_steps = 2; }).find("carrier_steps 2"),
            std::string::npos);
  EXPECT_NE(message([](Pattern& p) {
              p.carrier_steps = 3;
              p.carrier_period_px = 1.0;
            }).find("carrier_period_px 1"),
            std::string::npos);
  EXPECT_NE(message([](Pattern& p) {
              p.carrier_steps = 3;
              p.carrier_period_px = 9.0;
            }).find("has 3 of 9 steps"),
            std::string::npos);
  EXPECT_NE(message([](Pattern& p) { p.exposure_ratio = 1.0 + p.step; }).find("1 of 3 steps"),
            std::string::npos);
}

TEST(PatternSequence, RefusesGrayCellsWiderThanTheFringes) {
  PatternSequence sequence;
  sequence.width = sequence.height = 64;
  for (int step = 0; step < 3; ++step) sequence.frames.push_back(Phase(Axis::kU, 8.0, step, 3));
  sequence.frames.push_back(Gray(0, false));
  sequence.frames.back().cell_px = 9.0;
  const Status status = Validate(sequence, "p");
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().message,
            "p: axis u: Gray cells of 9 px leave the order of fringes of 8 px open");
  sequence.frames.back().cell_px = 8.0;
  EXPECT_TRUE(Validate(sequence, "p"));
}

TEST(RenderPattern, CarrierMultipliesAcross) {
  Pattern pattern = Phase(Axis::kU, 2.0, 1, 3);
  pattern.carrier_period_px = 7.0;
  pattern.carrier_step = 2;
  pattern.carrier_steps = 3;
  const Image<std::uint8_t> picture = RenderPattern(pattern, 40, 30, 1.0);
  for (int y = 0; y < 30; y += 3) {
    for (int x = 0; x < 40; x += 3) {
      const double fringe = 0.5 + 0.5 * std::cos(2.0 * kPi * (2.0 * (x + 0.5) / 40.0 - 1.0 / 3.0));
      const double carrier = 0.5 + 0.5 * std::cos(2.0 * kPi * ((y + 0.5) / 7.0 - 2.0 / 3.0));
      EXPECT_NEAR(picture(x, y), 255.0 * fringe * carrier, 0.501);
    }
  }
}

TEST(RenderPattern, PhaseIsTheStatedCosine) {
  Pattern pattern = Phase(Axis::kV, 5.0, 1, 4);
  pattern.phase_sign = -1.0;
  pattern.phase_offset_rad = 0.3;
  const Image<std::uint8_t> picture = RenderPattern(pattern, 9, 100, 1.0);
  for (int y = 0; y < 100; ++y) {
    const double phase = -(2.0 * kPi * 5.0 * (y + 0.5) / 100.0 + 0.3) - 0.5 * kPi;
    const double expected = 127.5 + 127.5 * std::cos(phase);
    for (const int x : {0, 4, 8}) EXPECT_NEAR(picture(x, y), expected, 0.501);
  }
}

TEST(RenderPattern, GammaIsUndone) {
  const Image<std::uint8_t> linear = RenderPattern(Phase(Axis::kU, 1.0, 0, 4), 256, 1, 1.0);
  const Image<std::uint8_t> bent = RenderPattern(Phase(Axis::kU, 1.0, 0, 4), 256, 1, 2.2);
  for (int x = 0; x < 256; ++x) {
    // A projector of gamma 2.2 makes the linear picture of the bent one.
    EXPECT_NEAR(255.0 * std::pow(bent(x, 0) / 255.0, 2.2), linear(x, 0), 1.6);
  }
}

TEST(RenderPattern, NeighbouringGrayCodesDifferInOneBit) {
  constexpr int kBits = 6;
  std::vector<unsigned> codes(64, 0);
  for (int bit = 0; bit < kBits; ++bit) {
    const Image<std::uint8_t> picture = RenderPattern(Gray(bit, false), 64, 2, 1.0);
    const Image<std::uint8_t> inverse = RenderPattern(Gray(bit, true), 64, 2, 1.0);
    for (int x = 0; x < 64; ++x) {
      EXPECT_EQ(picture(x, 1) + inverse(x, 1), 255);
      codes[static_cast<std::size_t>(x)] |= (picture(x, 0) > 127 ? 1U : 0U) << bit;
    }
  }
  for (unsigned x = 0; x < 64; ++x) EXPECT_EQ(codes[x], x ^ (x >> 1U));
}

TEST(RenderPattern, GrayCellAndOffsetShiftTheCode) {
  Pattern pattern = Gray(0, false);
  pattern.cell_px = 2;
  pattern.offset_px = -1.0;
  // code = floor((u + 1 + 1/2) / 2): 0, 1, 1, 2, 2, 3, ...; bit 0 of the Gray code: 0 1 1 1 1 0.
  const Image<std::uint8_t> picture = RenderPattern(pattern, 6, 1, 1.0);
  const std::vector<int> expected = {0, 255, 255, 255, 255, 0};
  for (int x = 0; x < 6; ++x) EXPECT_EQ(picture(x, 0), expected[static_cast<std::size_t>(x)]) << x;
}

TEST(RenderPattern, LightIsWhatThePictureIsMadeOf) {
  Pattern pattern = Phase(Axis::kV, 2.0, 1, 4);
  const Image<float> light = PatternLight(pattern, 3, 40);
  for (int y = 0; y < 40; ++y) {
    const double expected = 0.5 + 0.5 * std::cos(2.0 * kPi * (2.0 * (y + 0.5) / 40.0 - 0.25));
    EXPECT_NEAR(light(1, y), expected, 1e-6) << y;
  }
}

}  // namespace
}  // namespace fringe_fusion
