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
  // At N = 3 the measured phase nearly stands still in places (slope 1 - 3 * .29): no table helps.
  for (const int steps : {4, 5}) {
    const PhaseLut lut = MakePhaseLut(*response, steps);
    const Ripple after =
        RippleOf(cell, Pictures(cell.calibration(), 7.0, steps, nullptr), 7.0, &lut);
    EXPECT_LE(after.rad, 0.003) << steps;
  }
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
