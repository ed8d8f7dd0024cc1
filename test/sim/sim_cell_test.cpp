#include "fringe_fusion/sim/sim_cell.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "fringe_fusion/common/parallel.hpp"
#include "test/sim/scenes.hpp"

namespace fringe_fusion::sim {
namespace {

// Everything at once, at sizes that change pixels.
SimConfig EveryEffect() {
  SimConfig config;
  config.projector_gamma = 1.8;
  config.projector_black_ratio = 0.02;
  config.projector_blur_px = 0.7;
  config.projector_focus_m = 0.5;
  config.projector_defocus_px_m = 3.0;
  config.texture_contrast = 0.3;
  config.specular_ratio = 0.3;
  config.ambient_ratio = 0.05;
  config.interreflection = true;
  config.camera_blur_px = 0.5;
  config.gain_dn = 0.1;
  config.read_noise_dn = 1.0;
  config.turntable_angle_sigma_deg = 0.05;
  config.turntable_shift_sigma_mm = 0.2;
  config.arm_rotation_sigma_deg = 0.05;
  config.arm_translation_sigma_mm = 0.2;
  config.vibration_mm = 0.02;
  return config;
}

Image<std::uint8_t> Fringes(const CellCalibration& calibration) {
  Pattern pattern;
  pattern.kind = PatternKind::kPhase;
  pattern.fringes = 16.0;
  pattern.steps = 4;
  return RenderPattern(pattern, calibration.projector.width, calibration.projector.height, 1.0);
}

TEST(SimCell, SameBytesOnOneTwoAndThreeThreads) {
  const CellCalibration calibration = SmallScanner(4);
  const Mesh object = MakeFreeform(2e-3);
  std::vector<Image<std::uint8_t>> shots;
  for (const int threads : {1, 2, 3}) {
    const ThreadLimit limit(threads);
    SimCell cell = MakeCell(EveryEffect(), calibration, object, MakePlate(0.07, 0.005));
    ASSERT_TRUE(cell.MoveTo(TurntablePose(2, 9, 0.5, 25.0, {0.0, 0.0, 0.035}), 2));
    shots.push_back(std::get<0>(Shoot(cell, Fringes(calibration), 5)));
  }
  ASSERT_TRUE(std::equal(shots[0].begin(), shots[0].end(), shots[1].begin()));
  ASSERT_TRUE(std::equal(shots[0].begin(), shots[0].end(), shots[2].begin()));
}

TEST(SimCell, NeutralSettingsAreFreeOfNoise) {
  const CellCalibration calibration = SmallScanner();
  SimCell cell = MakeCell(SimConfig{}, calibration, MakePlane(0.4, 3));
  ASSERT_TRUE(cell.MoveTo(TopView(), 0));
  const Image<double> first = ShootDn(cell, Fringes(calibration), 0);
  const Image<double> second = ShootDn(cell, Fringes(calibration), 1);
  EXPECT_TRUE(std::equal(first.begin(), first.end(), second.begin()));
  const Image<double> black = ShootDn(cell, Flat(calibration, 0), 2);
  for (const double value : black) ASSERT_EQ(value, 0.0);
  SimConfig noisy;
  noisy.read_noise_dn = 2.0;
  SimCell noisy_cell = MakeCell(noisy, calibration, MakePlane(0.4, 3));
  ASSERT_TRUE(noisy_cell.MoveTo(TopView(), 0));
  const Image<double> third = ShootDn(noisy_cell, Fringes(calibration), 0);
  EXPECT_FALSE(std::equal(first.begin(), first.end(), third.begin()));
}

TEST(SimCell, WhiteLevelIsThatOfAFrontalWhiteSurface) {
  // The projector looks straight down from its nominal distance; the camera stands beside it.
  CellCalibration calibration = SmallScanner();
  SimConfig config;
  config.albedo = 1.0;
  config.bit_depth = 12;
  const double nominal = 0.5;
  Transform T_camera_projector = Transform::Identity();
  T_camera_projector.linear() = ExpRotation({0.0, -0.4, 0.0});
  T_camera_projector.translation() =
      Eigen::Vector3d(0.0, 0.0, 0.6) -
      T_camera_projector.linear() * Eigen::Vector3d(0.0, 0.0, nominal);
  calibration.T_projector_camera = T_camera_projector.inverse();
  calibration.projector.cx = 0.5 * (calibration.projector.width - 1);
  calibration.projector.cy = 0.5 * (calibration.projector.height - 1);
  calibration.projector.distortion = {};
  SimCell cell = MakeCell(config, calibration, MakePlane(0.3, 1));
  // Projector at (0, 0, 0.5) over the plane, facing down.
  Transform T_object_projector = TopView();
  ASSERT_TRUE(cell.MoveTo(T_object_projector * calibration.T_projector_camera, 0));
  const Image<double> white = ShootDn(cell, Flat(calibration, 255));
  const Eigen::Vector2d middle = Project(calibration.camera, {0.0, 0.0, 0.6});
  const double dn = white(static_cast<int>(middle.x()), static_cast<int>(middle.y()));
  EXPECT_NEAR(dn, 0.8 * 4095.0, 2.0);
}

TEST(SimCell, GammaBlackLevelAndAmbientHaveTheirSize) {
  const CellCalibration calibration = SmallScanner();
  SimConfig config;
  config.bit_depth = 12;
  const auto middle = [&](const SimConfig& settings, std::uint8_t value) {
    SimCell cell = MakeCell(settings, calibration, MakePlane(0.4, 3));
    EXPECT_TRUE(cell.MoveTo(TopView(), 0));
    return ShootDn(cell, Flat(calibration, value))(100, 75);
  };
  const double white = middle(config, 255);
  EXPECT_NEAR(middle(config, 128), white * 128.0 / 255.0, 1.0);
  SimConfig changed = config;
  changed.projector_gamma = 2.2;
  EXPECT_NEAR(middle(changed, 128), white * std::pow(128.0 / 255.0, 2.2), 1.0);
  changed = config;
  changed.projector_black_ratio = 0.05;
  EXPECT_NEAR(middle(changed, 0), 0.05 * white, 1.0);
  EXPECT_NEAR(middle(changed, 255), white, 1.0);
  changed = config;
  changed.ambient_ratio = 0.1;
  // Ambient light knows no cosine and no distance.
  EXPECT_NEAR(middle(changed, 0), 0.1 * 0.7 * 0.8 * 4095.0, 1.0);
  EXPECT_NEAR(middle(changed, 255), white + 0.1 * 0.7 * 0.8 * 4095.0, 1.5);
}

TEST(SimCell, InterreflectionBrightensACornerOnly) {
  const CellCalibration calibration = SmallScanner();
  SimConfig config;
  config.bit_depth = 12;
  const Mesh block = MakeStepBlock(2, 0.02, 0.03, 0.06);
  const auto shot = [&](bool bounce) {
    config.interreflection = bounce;
    SimCell cell = MakeCell(config, calibration, block);
    EXPECT_TRUE(cell.MoveTo(TurntablePose(1, 2, 0.5, 45.0, {0.0, 0.0, 0.01}), 0));
    return ShootDn(cell, Flat(calibration, 255));
  };
  const Image<double> without = shot(false);
  const Image<double> with = shot(true);
  double largest = 0.0;
  for (std::size_t i = 0; i < with.size(); ++i) {
    ASSERT_GE(with[i], without[i]);
    largest = std::max(largest, with[i] - without[i]);
  }
  EXPECT_GT(largest, 100.0);
  EXPECT_LT(largest, 0.7 * 0.7 * 4095.0);
}

TEST(SimCell, CameraBlurWidensAnEdge) {
  const CellCalibration calibration = SmallScanner();
  const auto steepest = [&](double blur_px) {
    SimConfig config;
    config.bit_depth = 12;
    config.camera_blur_px = blur_px;
    SimCell cell = MakeCell(config, calibration, MakePlane(0.05, 1));
    EXPECT_TRUE(cell.MoveTo(TopView(), 0));
    const Image<double> shot = ShootDn(cell, Flat(calibration, 255));
    double slope = 0.0;
    for (int x = 0; x < 100; ++x) slope = std::max(slope, std::abs(shot(x + 1, 75) - shot(x, 75)));
    return slope / shot(100, 75);
  };
  // The edge of a Gaussian blur of sigma s rises by 1 / (s sqrt(2 pi)) per pixel.
  EXPECT_NEAR(steepest(3.0), 1.0 / (3.0 * std::sqrt(2.0 * 3.14159265)), 0.01);
  EXPECT_GT(steepest(0.0), 0.45);
}

TEST(SimCell, VibrationMovesTheObjectByItsSigma) {
  const CellCalibration calibration = SmallScanner(8);
  Image<std::uint8_t> ramp(calibration.projector.width, calibration.projector.height);
  for (int y = 0; y < ramp.height(); ++y) {
    for (int x = 0; x < ramp.width(); ++x) ramp(x, y) = static_cast<std::uint8_t>(x);
  }
  SimConfig config;
  config.bit_depth = 12;
  const auto mean = [&](SimCell& cell, int frame) {
    const Image<double> shot = ShootDn(cell, ramp, frame);
    double sum = 0.0;
    for (int y = 20; y < 55; ++y) {
      for (int x = 30; x < 70; ++x) sum += shot(x, y);
    }
    return sum;
  };
  // A flat plane tells its height only: calibrate grey value against a known lift of the scanner.
  SimCell still = MakeCell(config, calibration, MakePlane(0.4, 1));
  ASSERT_TRUE(still.MoveTo(TopView(), 0));
  const double rest = mean(still, 0);
  EXPECT_EQ(rest, mean(still, 1));
  Transform lifted = TopView();
  lifted.translation().z() += 1e-3;
  ASSERT_TRUE(still.MoveTo(lifted, 0));
  const double per_mm = mean(still, 0) - rest;
  config.vibration_mm = 0.5;
  SimCell shaking = MakeCell(config, calibration, MakePlane(0.4, 1));
  ASSERT_TRUE(shaking.MoveTo(TopView(), 0));
  double sum = 0.0;
  constexpr int kFrames = 200;
  for (int frame = 0; frame < kFrames; ++frame) {
    sum += std::pow((mean(shaking, frame) - rest) / per_mm, 2);
  }
  EXPECT_NEAR(std::sqrt(sum / kFrames), 0.5, 4.0 * 0.5 / std::sqrt(2.0 * kFrames));
  // The truth is that of the object at rest.
  EXPECT_NEAR(shaking.Truth().points(50, 37).z(), 0.5F, 1e-3F);
}

TEST(SimCell, StreamFaultsComeAtTheirRates) {
  const CellCalibration calibration = SmallScanner(16);
  SimConfig config;
  config.read_noise_dn = 3.0;
  config.drop_probability = 0.2;
  config.duplicate_probability = 0.2;
  config.late_probability = 0.2;
  SimCell cell = MakeCell(config, calibration, MakePlane(0.4, 1));
  ASSERT_TRUE(cell.MoveTo(TopView(), 3));
  int dropped = 0;
  int duplicated = 0;
  int late = 0;
  Image<std::uint8_t> previous;
  for (int i = 0; i < 400; ++i) {
    const Result<CapturedFrame> frame = cell.Expose(Flat(calibration, 200), 0.02, i);
    if (!frame) {
      EXPECT_EQ(frame.error().message,
                fmt::format("simulated camera: frame {} of pose 3 was dropped", i));
      ++dropped;
      continue;
    }
    const auto& pixels = std::get<0>(frame->pixels);
    if (!previous.empty() && std::equal(pixels.begin(), pixels.end(), previous.begin()))
      ++duplicated;
    previous = pixels;
    const double period_ns = 0.04e9;
    const double delay = static_cast<double>(frame->stamp_ns) / period_ns - (3000.0 + i + 0.5);
    if (delay > 0.5) {
      EXPECT_NEAR(delay, 1.5, 1e-6);
      ++late;
    } else {
      EXPECT_NEAR(delay, 0.0, 1e-6);
    }
  }
  EXPECT_NEAR(dropped, 80, 32);
  EXPECT_NEAR(duplicated, 64, 29);
  EXPECT_NEAR(late, 64, 29);
}

TEST(SimCell, RefusesBadInput) {
  const CellCalibration calibration = SmallScanner();
  SimConfig config;
  config.bit_depth = 10;
  const Mesh plane = MakePlane(0.1, 1);
  const Result<SimCell> bits = SimCell::Create(config, calibration, plane, Mesh{});
  ASSERT_FALSE(bits);
  EXPECT_EQ(bits.error().message, "sim: bit_depth = 10 must be 8 or 12");
  config = SimConfig{};
  config.albedo = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(SimCell::Create(config, calibration, plane, Mesh{}));
  CellCalibration broken = calibration;
  broken.camera.fx = 0.0;
  EXPECT_FALSE(SimCell::Create(SimConfig{}, broken, plane, Mesh{}));
  EXPECT_FALSE(SimCell::Create(SimConfig{}, calibration, Mesh{}, plane));

  SimCell cell = MakeCell(SimConfig{}, calibration, plane);
  EXPECT_FALSE(cell.Expose(Flat(calibration, 1), 0.02, 0));  // no pose yet
  Transform nan = TopView();
  nan.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(cell.MoveTo(nan, 0));
  EXPECT_FALSE(cell.MoveTo(TopView(), -1));
  ASSERT_TRUE(cell.MoveTo(TopView(), 0));
  const Result<CapturedFrame> size = cell.Expose(Image<std::uint8_t>(3, 2), 0.02, 0);
  ASSERT_FALSE(size);
  EXPECT_EQ(size.error().message, "simulated projector: picture is 3 x 2, must be 320 x 200");
  EXPECT_FALSE(cell.Expose(Flat(calibration, 1), 0.0, 0));
  EXPECT_FALSE(cell.Expose(Flat(calibration, 1), std::numeric_limits<double>::quiet_NaN(), 0));
  EXPECT_TRUE(cell.Expose(Flat(calibration, 1), 0.02, 0));
}

}  // namespace
}  // namespace fringe_fusion::sim
