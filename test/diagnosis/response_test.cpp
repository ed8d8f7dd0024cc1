#include "fringe_fusion/diagnosis/response.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>

#include "fringe_fusion/io/image_io.hpp"
#include "test/diagnosis/scenes.hpp"

namespace fringe_fusion {
namespace {

constexpr double kPi = 3.14159265358979323846;

sim::SimCell PlaneCell(double gamma, int bit_depth = 12) {
  sim::SimConfig config;
  config.projector_gamma = gamma;
  config.projector_black_ratio = 0.01;
  config.projector_blur_px = 0.6;
  config.ambient_ratio = 0.05;
  config.bit_depth = bit_depth;
  sim::SimCell cell = sim::MakeCell(config, sim::SmallScanner(4), sim::MakePlane(0.3, 1));
  EXPECT_TRUE(cell.MoveTo(sim::TopView(), 0));
  return cell;
}

Result<ResponseCurve> RampResponse(sim::SimCell& cell) {
  std::vector<int> values;
  std::vector<CapturedFrame> frames;
  for (int value = 0; value <= 255; value += 15) {
    values.push_back(value);
    frames.push_back(
        *cell.Expose(sim::Flat(cell.calibration(), static_cast<std::uint8_t>(value)), 0.02, value));
  }
  return MeasureResponse(values, frames);
}

// Phase error of one N-step set of `fringes` against the true coordinates, by harmonic of the
// fringe: the ripple that a surface would show. Rounding and noise average out.
struct Ripple {
  double rad = 0.0;  // root sum of squares of the amplitudes of harmonics 1 .. 2 N
};

Ripple RippleOf(sim::SimCell& cell, const std::vector<Image<std::uint8_t>>& pictures,
                double fringes, const PhaseLut* lut = nullptr) {
  const sim::ViewTruth truth = cell.Truth();
  const auto steps = static_cast<int>(pictures.size());
  std::vector<Image<double>> shots;
  for (int n = 0; n < steps; ++n) {
    shots.push_back(sim::ShootDn(cell, pictures[static_cast<std::size_t>(n)], n));
  }
  std::vector<double> cosine(static_cast<std::size_t>(2 * steps) + 1);
  std::vector<double> sine(cosine.size());
  double count = 0.0;
  const double rad_per_px = 2.0 * kPi * fringes / pictures[0].width();
  for (std::size_t i = 0; i < truth.u.size(); ++i) {
    if (truth.lit[i] == 0) continue;
    const double phase = rad_per_px * (static_cast<double>(truth.u[i]) + 0.5);
    double s = 0.0;
    double c = 0.0;
    for (int n = 0; n < steps; ++n) {
      s += shots[static_cast<std::size_t>(n)][i] * std::sin(2.0 * kPi * n / steps);
      c += shots[static_cast<std::size_t>(n)][i] * std::cos(2.0 * kPi * n / steps);
    }
    double measured = std::atan2(s, c);
    if (lut != nullptr) measured = CorrectPhase(*lut, measured);
    const double error = std::remainder(measured - phase, 2.0 * kPi);
    for (std::size_t k = 1; k < cosine.size(); ++k) {
      cosine[k] += error * std::cos(static_cast<double>(k) * phase);
      sine[k] += error * std::sin(static_cast<double>(k) * phase);
    }
    count += 1.0;
  }
  double squares = 0.0;
  for (std::size_t k = 1; k < cosine.size(); ++k) {
    squares += std::pow(2.0 * cosine[k] / count, 2) + std::pow(2.0 * sine[k] / count, 2);
  }
  return {std::sqrt(squares)};
}

std::vector<Image<std::uint8_t>> Pictures(const CellCalibration& calibration, double fringes,
                                          int steps, const ResponseCurve* response) {
  std::vector<Image<std::uint8_t>> pictures;
  for (int n = 0; n < steps; ++n) {
    Pattern pattern;
    pattern.kind = PatternKind::kPhase;
    pattern.fringes = fringes;
    pattern.step = n;
    pattern.steps = steps;
    const CameraModel& projector = calibration.projector;
    pictures.push_back(
        response == nullptr
            ? RenderPattern(pattern, projector.width, projector.height, 1.0)
            : RenderCorrectedPattern(pattern, projector.width, projector.height, *response));
  }
  return pictures;
}

TEST(Response, RampGivesTheCurveOfTheProjector) {
  sim::SimCell cell = PlaneCell(2.2);
  const auto response = RampResponse(cell);
  ASSERT_TRUE(response) << response.error().message;
  EXPECT_NEAR(response->gamma, 2.2, 0.01);
  for (std::size_t i = 0; i < 256; ++i) {
    EXPECT_NEAR(response->light[i], std::pow(static_cast<double>(i) / 255.0, 2.2), 0.004) << i;
  }
}

TEST(Response, OrdinaryScanGivesTheSameCurve) {
  for (const double gamma : {1.0, 1.6, 2.2}) {
    sim::SimConfig config;
    config.projector_gamma = gamma;
    config.projector_blur_px = 0.5;
    config.gain_dn = 0.05;
    config.read_noise_dn = 1.0;
    config.ambient_ratio = 0.05;
    sim::SimCell cell = test::MakePartCell(config, 4, 2);
    const ImageStack stack =
        test::Capture(cell, test::MakePatterns(cell.calibration(), "1,6,32", 4));
    const auto response = ResponseFromScan(stack, {});
    ASSERT_TRUE(response) << response.error().message;
    EXPECT_NEAR(response->gamma, gamma, 0.03);
    for (std::size_t i = 0; i < 256; ++i) {
      EXPECT_NEAR(response->light[i], std::pow(static_cast<double>(i) / 255.0, gamma), 0.02) << i;
    }
  }
}

TEST(Response, CorrectedPatternLeavesLittleRipple) {
  sim::SimCell cell = PlaneCell(2.2);
  const auto response = RampResponse(cell);
  ASSERT_TRUE(response);
  constexpr double kFringes = 7.0;
  for (const int steps : {3, 4}) {
    const Ripple before =
        RippleOf(cell, Pictures(cell.calibration(), kFringes, steps, nullptr), kFringes);
    // The closed form of science section 2.2.
    const double expected = steps == 3 ? 0.29 : 0.0106;
    EXPECT_NEAR(before.rad, expected, 0.15 * expected) << steps;
    const Ripple after =
        RippleOf(cell, Pictures(cell.calibration(), kFringes, steps, &*response), kFringes);
    EXPECT_LE(after.rad, 0.003) << steps;
  }
}

TEST(Response, PhaseTableAfterCaptureLeavesLittleRipple) {
  sim::SimCell cell = PlaneCell(2.2);
  const auto response = RampResponse(cell);
  ASSERT_TRUE(response);
  for (const int steps : {3, 4, 5}) {
    const PhaseLut lut = MakePhaseLut(*response, steps);
    const Ripple after =
        RippleOf(cell, Pictures(cell.calibration(), 7.0, steps, nullptr), 7.0, &lut);
    RecordProperty(fmt::format("table_{}_steps_rad", steps), fmt::format("{:.5f}", after.rad));
    EXPECT_LE(after.rad, steps == 3 ? 0.006 : 0.003) << steps;
  }
}

// Ripple of a decoded row of coordinates: as RippleOf, by the true phase of the finest set.
double DecodedRipple(const PhaseMap& map, const sim::ViewTruth& truth, double fringes, int size_px,
                     int steps) {
  std::vector<double> cosine(static_cast<std::size_t>(2 * steps) + 1);
  std::vector<double> sine(cosine.size());
  double count = 0.0;
  for (std::size_t i = 0; i < map.u.size(); ++i) {
    if (map.mask[i] != 0 || truth.lit[i] == 0) continue;
    const double rad_per_px = 2.0 * kPi * fringes / size_px;
    const double phase = rad_per_px * (static_cast<double>(truth.u[i]) + 0.5);
    const double error = rad_per_px * static_cast<double>(map.u[i] - truth.u[i]);
    for (std::size_t k = 1; k < cosine.size(); ++k) {
      cosine[k] += error * std::cos(static_cast<double>(k) * phase);
      sine[k] += error * std::sin(static_cast<double>(k) * phase);
    }
    count += 1.0;
  }
  EXPECT_GT(count, 0.05 * static_cast<double>(map.u.size()));
  double squares = 0.0;
  for (std::size_t k = 1; k < cosine.size(); ++k) {
    squares += std::pow(2.0 * cosine[k] / count, 2) + std::pow(2.0 * sine[k] / count, 2);
  }
  return std::sqrt(squares);
}

TEST(Response, ScanOfUncorrectedPatternsIsDecodedWithoutRipple) {
  sim::SimCell cell = PlaneCell(2.2);
  auto ramp = RampResponse(cell);
  ASSERT_TRUE(ramp);
  const int size_px = cell.calibration().projector.width;
  for (const int steps : {3, 4, 5}) {
    const ImageStack stack =
        test::Capture(cell, test::MakePatterns(cell.calibration(), "1,7", steps));
    const sim::ViewTruth truth = cell.Truth();
    auto own = ResponseFromScan(stack, {});
    ASSERT_TRUE(own) << own.error().message;
    const auto ripple = [&](const std::optional<ResponseCurve>& response) {
      const auto map = DecodeWithResponse(stack, {}, {}, response);
      EXPECT_TRUE(map) << map.error().message;
      return map ? DecodedRipple(*map, truth, 7.0, size_px, steps) : 1.0;
    };
    const double before = ripple({});
    EXPECT_EQ(before, ripple(*ramp));  // to be undone in the patterns
    ramp->use = own->use = ResponseUse::kPhase;
    const double after = ripple(*ramp);
    const auto map = DecodeWithResponse(stack, {}, {}, *ramp);
    ASSERT_TRUE(map);
    EXPECT_GT(std::count(map->mask.begin(), map->mask.end(), 0), 0.9 * 160 * 120);
    RecordProperty(fmt::format("before_{}_steps_rad", steps), fmt::format("{:.5f}", before));
    RecordProperty(fmt::format("after_{}_steps_rad", steps), fmt::format("{:.5f}", after));
    EXPECT_GT(before, 0.01) << steps;
    // At N = 3 an error of the second harmonic counts three times, and the scan's own curve is bent
    // by the ripple of its finest set.
    EXPECT_LE(after, steps == 3 ? 0.006 : 0.003) << steps;
    const double by_itself = steps == 3 ? 0.0 : ripple(*own);
    EXPECT_LE(by_itself, 0.003) << steps;
    ramp->use = ResponseUse::kPatterns;
  }
}

TEST(Response, PhaseTableKnowsWhatBlurLeavesOfTheRipple) {
  sim::SimConfig config;
  config.projector_gamma = 2.2;
  config.projector_blur_px = 2.0;  // 32 fringes of 8 px keep a third of their amplitude
  config.bit_depth = 12;
  sim::SimCell cell = sim::MakeCell(config, sim::SmallScanner(4), sim::MakePlane(0.3, 1));
  ASSERT_TRUE(cell.MoveTo(sim::TopView(), 0));
  ResponseCurve response = PowerResponse(2.2);
  response.use = ResponseUse::kPhase;
  const int size_px = cell.calibration().projector.width;
  const ImageStack stack = test::Capture(cell, test::MakePatterns(cell.calibration(), "1,20", 4));
  const auto map = DecodeWithResponse(stack, {}, {}, response);
  ASSERT_TRUE(map) << map.error().message;
  // The table of sharp fringes would bring in the ripple of .0106 rad that blur took away.
  EXPECT_LE(DecodedRipple(*map, cell.Truth(), 20.0, size_px, 4), 0.003);
  EXPECT_NEAR(PhaseRipple(response, 4), 0.0106, 5e-4);
  // Harmonic k keeps c^(k^2 - 1) of the first. Ref: science section 2.2, b_3 of gamma 2.2.
  const double b3 = 1.2 / 4.2 * 0.2 / 5.2;
  const PhaseLut blurred = MakePhaseLut(response, 4, 0.8);
  const double largest = *std::max_element(blurred.error_rad.begin(), blurred.error_rad.end());
  EXPECT_NEAR(largest, b3 * std::pow(0.8, 8), 3e-5);
}

TEST(Response, PhaseTableIsRefusedWhereItWouldHarm) {
  const auto message = [](const Result<PhaseCorrection>& correction) {
    return correction ? std::string() : correction.error().message;
  };
  sim::SimCell cell = PlaneCell(2.2);
  const ResponseCurve response = PowerResponse(2.2);
  const PatternSequence sequence = test::MakePatterns(cell.calibration(), "1,7", 4);
  // Patterns that were corrected.
  const std::string twice =
      message(MakePhaseCorrection(response, test::Capture(cell, sequence, 2.2), {}));
  EXPECT_NE(twice.find("corrected already"), std::string::npos) << twice;
  EXPECT_TRUE(MakePhaseCorrection(response, test::Capture(cell, sequence), {}));
  // b_2 = .4: at N = 3 the measured phase moves by (1 - 2 b_2) / (1 + b_2) = 1 / 7 of the true one.
  sim::SimCell steep = PlaneCell(3.0);
  const std::string few = message(MakePhaseCorrection(
      PowerResponse(3.0), test::Capture(steep, test::MakePatterns(steep.calibration(), "1,7", 3)),
      {}));
  EXPECT_NE(few.find("take more steps"), std::string::npos) << "'" << few << "'";
  PatternConfig gray;
  gray.gray = true;
  gray.fringes = "";
  const CameraModel& projector = cell.calibration().projector;
  const auto bars = MakeSequence(gray, projector.width, projector.height);
  ASSERT_TRUE(bars) << bars.error().message;
  const std::string none = message(MakePhaseCorrection(response, test::Capture(cell, *bars), {}));
  EXPECT_NE(none.find("no step fits to correct"), std::string::npos) << "'" << none << "'";
  EXPECT_FALSE(MakePhaseCorrection(response, ImageStack{}, {}));
}

TEST(Response, StatesHowSureTheGammaIs) {
  // A noisier camera is less sure; the true gamma lies within what is stated and the bias that the
  // test above allows.
  std::vector<double> sigmas;
  for (const double noise : {0.5, 2.0}) {
    sim::SimConfig config;
    config.projector_gamma = 1.8;
    config.gain_dn = 0.02;
    config.read_noise_dn = noise;
    sim::SimCell cell = test::MakePartCell(config, 4, 2);
    const auto response = ResponseFromScan(
        test::Capture(cell, test::MakePatterns(cell.calibration(), "1,6,32", 4)), {});
    ASSERT_TRUE(response) << response.error().message;
    sigmas.push_back(response->sigma_gamma);
    EXPECT_LT(std::abs(response->gamma - 1.8), 4.0 * response->sigma_gamma + 0.02);
  }
  EXPECT_GT(sigmas[0], 0.0);
  EXPECT_LT(sigmas[0], 0.02);
  EXPECT_GT(sigmas[1], sigmas[0]);
}

TEST(Response, CorrectedPicturesKeepCarrierAndCode) {
  Pattern pattern;
  pattern.kind = PatternKind::kPhase;
  pattern.fringes = 3.0;
  pattern.steps = 3;
  pattern.carrier_period_px = 8.0;
  pattern.carrier_step = 1;
  pattern.carrier_steps = 3;
  const ResponseCurve response = PowerResponse(2.2);
  const Image<std::uint8_t> picture = RenderCorrectedPattern(pattern, 64, 32, response);
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 64; ++x) {
      const double fringe = 0.5 + 0.5 * std::cos(2.0 * kPi * 3.0 * (x + 0.5) / 64.0);
      const double carrier = 0.5 + 0.5 * std::cos(2.0 * kPi * ((y + 0.5) / 8.0 - 1.0 / 3.0));
      EXPECT_NEAR(response.light[picture(x, y)], fringe * carrier, 0.5 * 2.2 / 255.0);
    }
  }
  Pattern gray;
  gray.kind = PatternKind::kGray;
  const Image<std::uint8_t> bars = RenderCorrectedPattern(gray, 8, 1, response);
  const Image<std::uint8_t> plain = RenderPattern(gray, 8, 1, 1.0);
  EXPECT_TRUE(std::equal(bars.begin(), bars.end(), plain.begin()));
  // Without a response the gamma counts.
  const Image<std::uint8_t> bent =
      RenderCorrectedPattern(pattern, 64, 32, PatternCorrection{2.2, {}});
  const Image<std::uint8_t> expected = RenderPattern(pattern, 64, 32, 2.2);
  EXPECT_TRUE(std::equal(bent.begin(), bent.end(), expected.begin()));
}

TEST(Response, HarmonicsFollowTheClosedForm) {
  // b_{k+1} = b_k (gamma - k) / (gamma + k + 1). Ref: science section 2.2.
  for (const double gamma : {1.1, 1.5, 2.2}) {
    const std::vector<double> b = Harmonics(PowerResponse(gamma), 6);
    double expected = 1.0;
    for (int k = 1; k < 5; ++k) {
      expected *= (gamma - k) / (gamma + k + 1.0);
      EXPECT_NEAR(b[static_cast<std::size_t>(k) + 1], expected, 2e-4) << gamma << " " << k;
    }
  }
}

TEST(Response, ChoosesTheLeastStepsWhoseRippleIsBelowTheNoise) {
  EXPECT_EQ(ChooseSteps(PowerResponse(1.0), 0.02, 16).value(), 3);
  // Gamma 2.2: ripple .0106 rad at N = 4, .0013 at N = 5 (science section 2.2).
  EXPECT_EQ(ChooseSteps(PowerResponse(2.2), 0.06, 16).value(), 4);
  EXPECT_EQ(ChooseSteps(PowerResponse(2.2), 0.02, 16).value(), 5);
  const auto none = ChooseSteps(PowerResponse(2.2), 0.001, 4);
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().message.find("ripple"), std::string::npos);
  EXPECT_FALSE(ChooseSteps(PowerResponse(2.2), std::nan(""), 16));
}

TEST(Response, InverseTableUndoesTheCurve) {
  const ResponseCurve response = PowerResponse(2.2);
  const auto lut = InverseLut(response);
  EXPECT_EQ(lut[0], 0);
  EXPECT_EQ(lut[255], 255);
  for (std::size_t v = 0; v < 256; ++v) {
    EXPECT_NEAR(response.light[lut[v]], static_cast<double>(v) / 255.0, 0.5 * 2.2 / 255.0 + 1e-6);
  }
}

TEST(Response, RefusesBadRamps) {
  sim::SimCell cell = PlaneCell(1.0);
  const auto shot = *cell.Expose(sim::Flat(cell.calibration(), 100), 0.02, 0);
  EXPECT_FALSE(MeasureResponse({0, 255}, {shot, shot}));
  EXPECT_FALSE(MeasureResponse({0, 100, 200}, {shot, shot, shot}));
  EXPECT_FALSE(MeasureResponse({0, 100, 255}, {shot, shot, shot}));  // white is not brighter
  EXPECT_FALSE(ResponseFromScan(ImageStack{}, {}));
  EXPECT_FALSE(EstimateGamma({}));
}

// Published: gamma 1.6448 from pattern gammas .75 and 1.25, 8 fringes over 1920 px, on a plane.
class KaminoGamma : public testing::Test {
 protected:
  void SetUp() override {
    const char* root = std::getenv("FRINGE_FUSION_DATA");
    folder_ = std::filesystem::path(root != nullptr ? root
                                                    : std::string(SOURCE_DIR) + "/../shared/data") /
              "kamino_gamma";
    if (!std::filesystem::exists(folder_)) {
      GTEST_SKIP() << "skipped: no data at " << folder_.string();
    }
  }

  [[nodiscard]] CapturedFrame Read(int index) const {
    CapturedFrame frame;
    frame.pixels = ReadGrayImage((folder_ / fmt::format("pat{:02}.png", index)).string()).value();
    return frame;
  }

  // 10 bits per axis in cells of 2 px, coarsest first, each with its inverse, then white and black.
  [[nodiscard]] PhaseMap DecodeGrayCode() const {
    ImageStack stack;
    stack.sequence.width = 1920;
    stack.sequence.height = 1080;
    for (int i = 0; i < 42; ++i) {
      Pattern pattern;
      pattern.kind = i < 40 ? PatternKind::kGray : PatternKind::kWhite;
      if (i == 41) pattern.kind = PatternKind::kBlack;
      pattern.axis = i < 20 ? Axis::kU : Axis::kV;
      pattern.bit = 9 - (i % 20) / 2;
      pattern.inverse = i % 2 == 1;
      pattern.cell_px = 2;
      stack.sequence.frames.push_back(pattern);
      stack.frames.push_back(Read(12 + i));
    }
    PhaseConfig config;
    config.gray_one_per_cell = false;
    return DecodePhase(stack, config).value();
  }

  [[nodiscard]] GammaSet Set(int first, const Image<float>& coordinate) const {
    // Projected in the order of shifts -1, 0, 1.
    GammaSet set{{Read(first + 1), Read(first), Read(first + 2)}, coordinate};
    for (float& value : set.phase_rad) value *= static_cast<float>(2.0 * kPi / 240.0);
    return set;
  }

  std::filesystem::path folder_;
};

TEST_F(KaminoGamma, IsThePublishedOne) {
  const PhaseMap map = DecodeGrayCode();
  const auto estimate = EstimateGamma(
      {{0.75, {Set(0, map.u), Set(6, map.v)}}, {1.25, {Set(3, map.u), Set(9, map.v)}}});
  ASSERT_TRUE(estimate) << estimate.error().message;
  EXPECT_NEAR(estimate->gamma, 1.645, 0.02);
  RecordProperty("gamma", fmt::format("{:.4f}", estimate->gamma));
}

}  // namespace
}  // namespace fringe_fusion
