#include "fringe_fusion/pose/epipolar_health.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "fringe_fusion/io/config_yaml.hpp"
#include "test/triangulation/analytic_view.hpp"

namespace fringe_fusion {
namespace {

constexpr double kRadPerDeg = M_PI / 180.0;

// The scanner of analytic_view before a wavy surface.
PhaseMap Scan(const CellCalibration& cell, unsigned seed) {
  const auto depth = [](const Eigen::Vector2d& ray) {
    return 0.5 + 0.02 * std::sin(20.0 * ray.x()) * std::cos(15.0 * ray.y());
  };
  PhaseMap phase = test::MakeView(cell, depth, {0.03, 0.03}, seed).phase;
  for (std::size_t i = 0; i < phase.u.size(); ++i) {
    const bool inside =
        phase.u[i] >= 0.0F && phase.v[i] >= 0.0F && phase.u[i] <= 319.0F && phase.v[i] <= 199.0F;
    if (!inside) phase.mask[i] = static_cast<std::uint8_t>(MaskReason::kOutsideProjector);
  }
  return phase;
}

HealthConfig Sensitive() {
  HealthConfig config;
  config.warn_px = 0.02;
  config.error_px = 20.0;
  config.block_px = 16;
  return config;
}

TEST(CheckHealth, TrueCalibrationIsWell) {
  const CellCalibration cell = test::MakeScanner();
  const auto report = CheckHealth(Scan(cell, 1), cell, {}, Sensitive());
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_EQ(report->level, HealthLevel::kOk) << report->message;
  EXPECT_NEAR(report->median_px, 0.0, 0.002);
  EXPECT_NEAR(report->median_abs_px, 0.6745 * 0.03, 0.002);
  EXPECT_NEAR(report->reduced_chi2, 1.0, 0.1);
  EXPECT_LT(report->systematic_px, 0.01);
  EXPECT_EQ(report->motion.moved, MovedDevice::kNone) << report->motion.significance;
  EXPECT_EQ(report->residual_px.width(), cell.camera.width);
}

// True rig = calibrated rig with one device turned about its own centre.
TEST(CheckHealth, TellsWhichDeviceTurned) {
  const CellCalibration calibrated = test::MakeScanner();
  const Eigen::Matrix3d turn = ExpRotation(kRadPerDeg * Eigen::Vector3d(0.3, 0.1, 0.2));
  CellCalibration camera_turned = calibrated;
  camera_turned.T_projector_camera.linear() = calibrated.T_projector_camera.linear() * turn;
  const auto camera = CheckHealth(Scan(camera_turned, 2), calibrated, {}, Sensitive());
  ASSERT_TRUE(camera) << camera.error().message;
  EXPECT_EQ(camera->level, HealthLevel::kWarn) << camera->message;
  EXPECT_EQ(camera->motion.moved, MovedDevice::kCamera) << camera->message;
  EXPECT_NEAR(camera->motion.turn_deg, std::sqrt(0.14), 0.05);
  EXPECT_NE(camera->message.find("camera has turned"), std::string::npos) << camera->message;
  EXPECT_LT(camera->refit_systematic_px, 0.01);

  CellCalibration projector_turned = calibrated;
  Transform T = Transform::Identity();
  T.linear() = turn;
  projector_turned.T_projector_camera = T * calibrated.T_projector_camera;
  const auto projector = CheckHealth(Scan(projector_turned, 3), calibrated, {}, Sensitive());
  ASSERT_TRUE(projector) << projector.error().message;
  EXPECT_EQ(projector->motion.moved, MovedDevice::kProjector) << projector->message;

  // About the baseline: both explanations hold.
  CellCalibration about_baseline = calibrated;
  T.linear() =
      ExpRotation(0.5 * kRadPerDeg * calibrated.T_projector_camera.translation().normalized());
  about_baseline.T_projector_camera = T * calibrated.T_projector_camera;
  const auto either = CheckHealth(Scan(about_baseline, 4), calibrated, {}, Sensitive());
  ASSERT_TRUE(either) << either.error().message;
  EXPECT_EQ(either->motion.moved, MovedDevice::kEither) << either->message;
}

TEST(CheckHealth, AnotherLensIsNoMotion) {
  const CellCalibration calibrated = test::MakeScanner();
  CellCalibration changed = calibrated;
  changed.projector.distortion[0] += 1.5;
  const auto report = CheckHealth(Scan(changed, 5), calibrated, {}, Sensitive());
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_NE(report->level, HealthLevel::kOk);
  EXPECT_NE(report->message.find("another pose leaves"), std::string::npos) << report->message;
}

TEST(CheckHealth, FarOffIsAnError) {
  const CellCalibration calibrated = test::MakeScanner();
  CellCalibration changed = calibrated;
  changed.T_projector_camera.linear() =
      calibrated.T_projector_camera.linear() * ExpRotation(Eigen::Vector3d(0.03, 0.0, 0.0));
  const auto report = CheckHealth(Scan(changed, 6), calibrated, {}, {});
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_EQ(report->level, HealthLevel::kError);
}

TEST(CheckHealth, RefusesWhatDoesNotFit) {
  const CellCalibration cell = test::MakeScanner();
  PhaseMap phase = Scan(cell, 1);
  phase.u = Image<float>();
  EXPECT_FALSE(CheckHealth(phase, cell, {}, {}));
  phase = Scan(cell, 1);
  CellCalibration other = cell;
  other.camera.width = 161;
  EXPECT_FALSE(CheckHealth(phase, other, {}, {}));
  HealthConfig config;
  config.alarm_sigma = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(CheckHealth(phase, cell, {}, config));
}

HealthReport ReportOf(double median_px) {
  HealthReport report;
  report.median_px = median_px;
  return report;
}

TEST(HealthHistory, FindsADriftAndNotANoise) {
  const CellCalibration cell = test::MakeScanner();
  std::mt19937 engine(7);
  std::normal_distribution<double> unit;
  HealthHistory still;
  HealthHistory drifting;
  EXPECT_FALSE(still.Fit({}).significant);
  for (int i = 0; i < 30; ++i) {
    const auto stamp = static_cast<std::int64_t>(i * 360e9);  // every 0.1 h
    const double noise = 0.01 * unit(engine);
    still.Add(stamp, ReportOf(noise), cell);
    drifting.Add(stamp, ReportOf(noise + 0.02 * i), cell);
  }
  still.Add(0, ReportOf(std::numeric_limits<double>::quiet_NaN()), cell);
  const Drift none = still.Fit({});
  EXPECT_EQ(none.num_scans, 30);
  EXPECT_FALSE(none.significant) << none.message;
  const Drift drift = drifting.Fit({});
  EXPECT_TRUE(drift.significant);
  EXPECT_NEAR(drift.rate_px_h, 0.2, 0.01);
  EXPECT_NEAR(drift.span_h, 2.9, 1e-9);
}

TEST(HealthConfig, FileEqualsTheDefaults) {
  const auto file = LoadConfigFile<HealthConfig>(SOURCE_DIR "/config/health.yaml");
  ASSERT_TRUE(file) << file.error().message;
  const HealthConfig defaults;
  EXPECT_EQ(file->warn_px, defaults.warn_px);
  EXPECT_EQ(file->error_px, defaults.error_px);
  EXPECT_EQ(file->alarm_sigma, defaults.alarm_sigma);
  EXPECT_EQ(file->block_px, defaults.block_px);
  EXPECT_EQ(file->min_turn_deg, defaults.min_turn_deg);
}

}  // namespace
}  // namespace fringe_fusion
