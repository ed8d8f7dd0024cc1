#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "fringe_fusion/sim/sim_cell.hpp"
#include "test/sim/scenes.hpp"

namespace fringe_fusion::sim {
namespace {

// Mean grey value of the middle of a plane in frames 0..count-1.
std::vector<double> Levels(const SimConfig& config, std::uint8_t value, double exposure_s,
                           int count) {
  const CellCalibration calibration = SmallScanner(8);
  SimCell cell = MakeCell(config, calibration, MakePlane(0.4, 1));
  EXPECT_TRUE(cell.MoveTo(TopView(), 2));
  std::vector<double> levels;
  for (int i = 0; i < count; ++i) {
    const auto frame = cell.Expose(Flat(calibration, value), exposure_s, i);
    levels.push_back(static_cast<double>(std::get<1>(frame->pixels)(50, 37)));
  }
  return levels;
}

double PeakToPeak(const std::vector<double>& values) {
  return *std::max_element(values.begin(), values.end()) -
         *std::min_element(values.begin(), values.end());
}

TEST(LightFaults, AmbientFlickersUnlessTheExposureIsWholePeriods) {
  SimConfig config;
  config.bit_depth = 12;
  config.frame_period_s = 0.0413;
  config.ambient_ratio = 0.2;
  config.ambient_flicker_ratio = 0.5;
  EXPECT_LT(PeakToPeak(Levels(config, 0, 0.02, 60)), 1.5);
  // A quarter period more: the mean of the sine over 1.25 periods is sin(1.25 pi) / (1.25 pi).
  const double mean = std::abs(std::sin(1.25 * M_PI) / (1.25 * M_PI));
  const double ambient = 0.2 * 0.7 * 0.8 * 4095.0 * 0.0125 / 0.02;
  EXPECT_NEAR(PeakToPeak(Levels(config, 0, 0.0125, 60)), 2.0 * 0.5 * mean * ambient, 2.5);
}

TEST(LightFaults, ProjectorRippleScalesItsLightAlone) {
  SimConfig config;
  config.bit_depth = 12;
  config.frame_period_s = 0.0413;
  config.ambient_ratio = 0.2;
  config.projector_ripple_ratio = 0.3;
  config.projector_frame_hz = 50.0;
  EXPECT_LT(PeakToPeak(Levels(config, 255, 0.02, 60)), 1.5);
  EXPECT_LT(PeakToPeak(Levels(config, 0, 0.013, 60)), 1.5);  // ambient light does not ripple
  const double light =
      Levels(SimConfig(config), 255, 0.02, 1)[0] - Levels(SimConfig(config), 0, 0.02, 1)[0];
  const double mean = std::sin(0.65 * M_PI) / (0.65 * M_PI);
  EXPECT_NEAR(PeakToPeak(Levels(config, 255, 0.013, 60)), 0.6 * mean * 0.65 * light, 0.02 * light);
}

TEST(LightFaults, PanelScaleMovesAnEdgeByItsFactor) {
  const CellCalibration calibration = SmallScanner(4);
  const auto edge_of = [&](double scale) {
    SimConfig config;
    config.panel_scale = scale;
    SimCell cell = MakeCell(config, calibration, MakePlane(0.4, 1));
    EXPECT_TRUE(cell.MoveTo(TopView(), 0));
    Image<std::uint8_t> picture = Flat(calibration, 0);
    for (int y = 0; y < picture.height(); ++y) {
      for (int x = 160; x < picture.width(); ++x) picture(x, y) = 255;
    }
    const Image<double> shot = ShootDn(cell, picture);
    const ViewTruth truth = cell.Truth();
    const double half = 0.5 * *std::max_element(shot.begin(), shot.end());
    for (int x = 1; x < shot.width(); ++x) {
      if ((shot(x - 1, 75) < half) != (shot(x, 75) < half)) {
        return 0.5 * static_cast<double>(truth.u(x - 1, 75) + truth.u(x, 75));
      }
    }
    return 0.0;
  };
  EXPECT_NEAR(edge_of(1.0), 159.5, 2.0);
  EXPECT_NEAR(edge_of(0.8), 0.8 * 160.0 - 0.5, 2.0);
}

TEST(LightFaults, MisorderedFramesShowWhatWasAskedFor) {
  const CellCalibration calibration = SmallScanner(8);
  PatternConfig pattern;
  pattern.fringes = "1,8,32";  // The small projector has no room for 64.
  const PatternSequence sequence =
      MakeSequence(pattern, calibration.projector.width, calibration.projector.height).value();
  SimCell cell = MakeCell(SimConfig{}, calibration, MakePlane(0.4, 1));
  ASSERT_TRUE(cell.MoveTo(TopView(), 0));
  std::vector<int> shown(sequence.frames.size());
  for (std::size_t i = 0; i < shown.size(); ++i) shown[i] = static_cast<int>(i);
  const auto straight = CaptureStack(cell, sequence, 1.0, 0.02, 0);
  shown[4] = 7;
  shown[5] = -1;
  const auto stack = CaptureMisordered(cell, sequence, shown, 0.02, 0);
  ASSERT_TRUE(stack);
  const auto same = [&](std::size_t a, std::size_t b) {
    const auto& pixels = std::get<0>(stack->frames[a].pixels);
    return std::equal(pixels.begin(), pixels.end(),
                      std::get<0>(straight->frames[b].pixels).begin());
  };
  EXPECT_TRUE(same(3, 3));
  EXPECT_TRUE(same(4, 7));
  EXPECT_TRUE(same(5, 1));  // black
  shown[0] = 99;
  EXPECT_FALSE(CaptureMisordered(cell, sequence, shown, 0.02, 0));
}

}  // namespace
}  // namespace fringe_fusion::sim
