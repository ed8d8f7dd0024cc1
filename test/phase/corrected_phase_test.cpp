#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "fringe_fusion/diagnosis/response.hpp"
#include "fringe_fusion/phase/phase_correction.hpp"
#include "src/phase/decode_with.hpp"
#include "synthetic_stack.hpp"

namespace fringe_fusion {
namespace {

using test::MakeTestSequence;
using test::Synthesize;
using test::SyntheticScene;

SyntheticScene BentScene(double gamma) {
  SyntheticScene scene;
  scene.width = 128;
  scene.height = 96;
  scene.bit_depth = 12;
  scene.dark_dn = 200.0;
  scene.bright_dn = 3000.0;
  scene.gamma = gamma;
  return scene;
}

PhaseConfig ConfigOf(const SyntheticScene& scene) {
  PhaseConfig config;
  config.read_noise_dn = scene.read_noise_dn;
  config.gain_dn = scene.gain_dn;
  return config;
}

// The tables of a power law for every set of a sequence.
PhaseCorrection Tables(double gamma, const PatternSequence& sequence) {
  PhaseCorrection correction;
  for (const Pattern& pattern : sequence.frames) {
    if (pattern.kind != PatternKind::kPhase || pattern.step != 0) continue;
    correction.sets.push_back(
        {pattern.axis, pattern.fringes, MakePhaseLut(PowerResponse(gamma), pattern.steps)});
  }
  return correction;
}

struct Errors {
  int num_valid = 0;
  double largest_rad = 0.0;  // of the finest set
  double mean_square = 0.0;  // over the stated variance
};

Errors ErrorsOf(const PhaseMap& map, const SyntheticScene& scene, double fringes) {
  Errors errors;
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      if (map.mask(x, y) != 0) continue;
      const double apart_px = static_cast<double>(map.u(x, y)) - scene.u(x, y);
      const double rad = std::abs(apart_px) * 2.0 * M_PI * fringes / 128.0;
      errors.largest_rad = std::max(errors.largest_rad, rad);
      errors.mean_square += std::pow(apart_px / static_cast<double>(map.sigma_u(x, y)), 2);
      ++errors.num_valid;
    }
  }
  errors.mean_square /= errors.num_valid;
  return errors;
}

TEST(CorrectedPhase, HasNoRippleOfTheResponse) {
  struct Case {
    double gamma;
    int steps;
    double before_rad;  // at least, without the table
  };
  for (const Case& c : {Case{2.2, 4, 0.009}, Case{2.2, 5, 0.001}, Case{1.3, 3, 0.05}}) {
    const SyntheticScene scene = BentScene(c.gamma);
    const PatternSequence sequence = MakeTestSequence(false, "1,8", c.steps);
    const ImageStack stack = Synthesize(sequence, scene);
    const PhaseConfig config = ConfigOf(scene);
    const auto before = DecodePhase(stack, config);
    const auto after = DecodeCorrectedPhase(stack, config, Tables(c.gamma, sequence));
    ASSERT_TRUE(before && after);
    EXPECT_GT(ErrorsOf(*before, scene, 8.0).largest_rad, c.before_rad) << c.gamma << c.steps;
    const Errors errors = ErrorsOf(*after, scene, 8.0);
    EXPECT_GT(errors.num_valid, 0.98 * scene.width * scene.height) << c.gamma << c.steps;
    EXPECT_LE(errors.largest_rad, 0.001) << c.gamma << c.steps;
  }
}

TEST(CorrectedPhase, StatesItsNoise) {
  for (const int steps : {3, 4, 6}) {
    SyntheticScene scene = BentScene(steps == 3 ? 1.4 : 2.2);
    scene.read_noise_dn = 8.0;
    scene.gain_dn = 0.4;
    const PatternSequence sequence = MakeTestSequence(false, "1,8", steps);
    PhaseConfig config = ConfigOf(scene);
    config.phase_error_rad = 0.0;
    const auto map =
        DecodeCorrectedPhase(Synthesize(sequence, scene), config, Tables(scene.gamma, sequence));
    ASSERT_TRUE(map) << map.error().message;
    const Errors errors = ErrorsOf(*map, scene, 8.0);
    EXPECT_GT(errors.num_valid, 0.97 * scene.width * scene.height) << steps;
    EXPECT_GT(errors.mean_square, 0.9) << steps;
    EXPECT_LT(errors.mean_square, 1.1) << steps;
  }
}

TEST(CorrectedPhase, TakesEveryExposureThatIsNotSaturated) {
  SyntheticScene scene = BentScene(2.2);
  scene.read_noise_dn = 3.0;
  scene.gain_dn = 0.2;
  PatternConfig pattern;
  pattern.fringes = "1,8";
  pattern.exposures = "0.5,1,4";  // the last one saturates
  const PatternSequence sequence = MakeSequence(pattern, 128, 96).value();
  PhaseConfig config = ConfigOf(scene);
  config.phase_error_rad = 0.0;
  const auto map = DecodeCorrectedPhase(Synthesize(sequence, scene), config, Tables(2.2, sequence));
  ASSERT_TRUE(map) << map.error().message;
  const Errors errors = ErrorsOf(*map, scene, 8.0);
  EXPECT_GT(errors.num_valid, 0.97 * scene.width * scene.height);
  EXPECT_NEAR(errors.mean_square, 1.0, 0.1);
  // Nothing is left where all are.
  scene.bright_dn = 30000.0;
  const auto blind =
      DecodeCorrectedPhase(Synthesize(sequence, scene), config, Tables(2.2, sequence));
  ASSERT_TRUE(blind);
  EXPECT_EQ(std::count(blind->mask.begin(), blind->mask.end(),
                       static_cast<std::uint8_t>(MaskReason::kSaturated)),
            128 * 96);
}

TEST(CorrectedPhase, IsTheSameOnEveryInstructionSet) {
  SyntheticScene scene = BentScene(2.2);
  scene.read_noise_dn = 8.0;
  const PatternSequence sequence = MakeTestSequence(true, "4,16", 4);
  const ImageStack stack = Synthesize(sequence, scene);
  const PhaseCorrection tables = Tables(2.2, sequence);
  const auto best = DecodeCorrectedPhase(stack, {}, tables);
  const auto portable =
      decode::DecodeWith(decode::PortableKernels(), stack, {}, NoProgress, {}, &tables);
  ASSERT_TRUE(best && portable);
  for (const auto image : {&PhaseMap::u, &PhaseMap::sigma_u, &PhaseMap::v, &PhaseMap::modulation}) {
    EXPECT_EQ(std::memcmp(((*best).*image).data(), ((*portable).*image).data(),
                          sizeof(float) * ((*best).*image).size()),
              0);
  }
}

TEST(CorrectedPhase, KnowsWhatItCannotCorrect) {
  const SyntheticScene scene = BentScene(2.2);
  const PatternSequence sequence = MakeTestSequence(false, "1,8", 4);
  const auto message = [](const Status& status) {
    return status ? std::string() : status.error().message;
  };
  EXPECT_TRUE(CheckCorrectable(sequence));
  EXPECT_NE(message(CheckCorrectable(MakeTestSequence(true, "", 4))).find("it is a Gray code"),
            std::string::npos);
  PatternConfig config;
  config.micro = true;
  config.fringes = "15,16,17";
  EXPECT_NE(message(CheckCorrectable(MakeSequence(config, 128, 96).value())).find("micro"),
            std::string::npos);
  config.micro = false;
  config.fringes = "1,8";
  config.carrier_period_px = 8.0;
  EXPECT_NE(message(CheckCorrectable(MakeSequence(config, 128, 96).value())).find("carrier"),
            std::string::npos);
  PatternSequence uneven = sequence;
  uneven.frames[3].phase_offset_rad = 0.3;
  EXPECT_NE(message(CheckCorrectable(uneven)).find("not even"), std::string::npos);
  const ImageStack stack = Synthesize(sequence, scene);
  PhaseCorrection tables = Tables(2.2, sequence);
  tables.sets.back().lut = MakePhaseLut(PowerResponse(2.2), 5);
  const auto other = DecodeCorrectedPhase(stack, {}, tables);
  ASSERT_FALSE(other);
  EXPECT_NE(other.error().message.find("no table of 4 steps"), std::string::npos);
  EXPECT_FALSE(DecodeCorrectedPhase(stack, {}, {}));
}

TEST(CorrectedPhase, UndoesWhatTheTableSays) {
  // The first harmonic error of N = 4 under gamma 2.2. Ref: science section 2.2.
  const PhaseLut lut = MakePhaseLut(PowerResponse(2.2), 4);
  const double b3 = 1.2 / 4.2 * 0.2 / 5.2;
  const double b5 = b3 * (2.2 - 3.0) / 6.2 * (2.2 - 4.0) / 7.2;
  for (const double truth : {-3.0, -1.1, 0.2, 0.9, 2.9}) {
    const double sine = std::sin(truth) - b3 * std::sin(3.0 * truth) + b5 * std::sin(5.0 * truth);
    const double cosine = std::cos(truth) + b3 * std::cos(3.0 * truth) + b5 * std::cos(5.0 * truth);
    EXPECT_NEAR(CorrectPhase(lut, std::atan2(sine, cosine)), truth, 2e-4);
  }
}

}  // namespace
}  // namespace fringe_fusion
