// Targets rendered in the simulated cell, where every true pixel is known.
#include <gtest/gtest.h>

#include <cmath>

#include "fringe_fusion/calibration/sighting_from_scan.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"
#include "fringe_fusion/sim/target_plate.hpp"

namespace fringe_fusion {
namespace {

constexpr double kPi = 3.14159265358979323846;

CalibrationTarget RingDots() {
  CalibrationTarget target;
  target.kind = TargetKind::kRingDots;
  target.num_columns = 7;
  target.num_rows = 5;
  target.pitch_m = 0.018;
  target.dot_radius_m = 0.003;
  target.ring_radius_m = 0.0085;
  target.print_ratio = 0.45;
  return target;
}

CalibrationTarget RenderedChessboard() {
  CalibrationTarget target;
  target.num_columns = 8;
  target.num_rows = 5;
  target.pitch_m = 0.014;
  return target;
}

/// A cell with the noise and blur of real ones.
sim::SimConfig RealisticCell() {
  sim::SimConfig config;
  config.seed = 7;
  config.camera_blur_px = 0.7;
  config.projector_blur_px = 0.8;
  config.gain_dn = 0.05;
  config.read_noise_dn = 1.0;
  config.ambient_ratio = 0.05;
  config.albedo = 0.9;
  return config;
}

struct Rendered {
  CellCalibration calibration;
  Transform T_camera_target = Transform::Identity();
  ImageStack stack;
};

Rendered Render(const CalibrationTarget& target, const Transform& T_object_camera) {
  Rendered rendered;
  rendered.calibration = sim::DefaultCalibration();
  rendered.T_camera_target = T_object_camera.inverse();
  const sim::SurfacePrint print{MakeTargetPrint(target), Transform::Identity(), 1e-4};
  auto cell = sim::SimCell::Create(RealisticCell(), rendered.calibration,
                                   sim::MakeTargetPlate(print), Mesh{}, print);
  if (!cell) throw std::runtime_error(cell.error().message);
  if (const Status moved = cell->MoveTo(T_object_camera, 0); !moved) {
    throw std::runtime_error(moved.error().message);
  }
  PatternConfig patterns;
  patterns.fringes = "1,6,36";
  const auto sequence = MakeSequence(patterns, rendered.calibration.projector.width,
                                     rendered.calibration.projector.height);
  if (!sequence) throw std::runtime_error(sequence.error().message);
  auto stack = sim::CaptureStack(*cell, *sequence, 1.0, 0.02, 0);
  if (!stack) throw std::runtime_error(stack.error().message);
  rendered.stack = std::move(*stack);
  return rendered;
}

/// Centre of area of the imaged rim of a dot: the truth for the centre of the ellipse.
Eigen::Vector2d ImagedCentre(const Rendered& rendered, const Eigen::Vector3d& point,
                             double radius_m) {
  constexpr int kSides = 720;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double area = 0.0;
  const auto rim = [&](int k) {
    const double angle = 2.0 * kPi * k / kSides;
    const Eigen::Vector3d at =
        point + radius_m * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0);
    return Project(rendered.calibration.camera, rendered.T_camera_target * at);
  };
  const Eigen::Vector2d middle =
      Project(rendered.calibration.camera, rendered.T_camera_target * point);
  for (int k = 0; k < kSides; ++k) {
    const Eigen::Vector2d a = rim(k) - middle;
    const Eigen::Vector2d b = rim(k + 1) - middle;
    const double cross = a.x() * b.y() - a.y() * b.x();
    sum += cross / 6.0 * (a + b);
    area += cross / 2.0;
  }
  return middle + sum / area;
}

struct Errors {
  double camera_rms_px = 0.0;     ///< per axis
  double camera_ratio = 0.0;      ///< mean normalised squared error, 2 expected, over 2
  double projector_rms_px = 0.0;  ///< per axis
  double projector_ratio = 0.0;
  double centre_rms_px = 0.0;       ///< of TrueCentres, per axis
  double uncorrected_rms_px = 0.0;  ///< the same without the shift of the ellipse
};

Errors ErrorsOf(const Rendered& rendered, const CalibrationTarget& target,
                const TargetSighting& sighting) {
  const auto points = TargetPoints(target);
  const auto centres = TrueCentres(sighting, target);
  Errors errors;
  const auto count = 2.0 * static_cast<double>(sighting.points.size());
  for (std::size_t i = 0; i < sighting.points.size(); ++i) {
    const PointSighting& seen = sighting.points[i];
    const Eigen::Vector3d& point = points[static_cast<std::size_t>(seen.point)];
    const Eigen::Vector3d point_camera = rendered.T_camera_target * point;
    const Eigen::Vector2d centre = Project(rendered.calibration.camera, point_camera);
    const Eigen::Vector2d imaged =
        sighting.is_ellipse_centre ? ImagedCentre(rendered, point, DotRadius(target, seen.point))
                                   : centre;
    const Eigen::Vector2d camera = seen.pixel_camera - imaged;
    const Eigen::Vector2d projector =
        seen.pixel_projector - Project(rendered.calibration.projector,
                                       rendered.calibration.T_projector_camera * point_camera);
    errors.camera_rms_px += camera.squaredNorm() / count;
    errors.camera_ratio += camera.dot(seen.covariance_camera_px2.inverse() * camera) / count;
    errors.projector_rms_px += projector.squaredNorm() / count;
    errors.projector_ratio +=
        projector.dot(seen.covariance_projector_px2.inverse() * projector) / count;
    errors.centre_rms_px += (centres[i] - centre).squaredNorm() / count;
    errors.uncorrected_rms_px += (seen.pixel_camera - centre).squaredNorm() / count;
  }
  for (double* square : {&errors.camera_rms_px, &errors.projector_rms_px, &errors.centre_rms_px,
                         &errors.uncorrected_rms_px}) {
    *square = std::sqrt(*square);
  }
  return errors;
}

class RenderedTarget : public testing::TestWithParam<bool> {};

TEST_P(RenderedTarget, IsLocatedFarBelowAPixelInBothDevices) {
  const bool has_dots = GetParam();
  const CalibrationTarget target = has_dots ? RingDots() : RenderedChessboard();
  const Transform T_object_camera = sim::TargetView(MakeTargetPrint(target), 0.5, 0.45, -0.2, 0.1);
  const Rendered rendered = Render(target, T_object_camera);
  const auto sighting = SightTarget(rendered.stack, target, SightingConfig{}, "pose");
  ASSERT_TRUE(sighting) << sighting.error().message;
  EXPECT_EQ(sighting->name, "pose");
  ASSERT_EQ(sighting->points.size(), TargetPoints(target).size());
  for (const PointSighting& point : sighting->points) ASSERT_TRUE(point.has_projector);
  const Errors errors = ErrorsOf(rendered, target, *sighting);
  fmt::print(
      "{}: camera rms {:.4f} px (squared over stated {:.2f}), projector rms {:.4f} px "
      "({:.2f}); true centre {:.4f} px, without the shift of the ellipse {:.4f} px\n",
      TargetKindName(target.kind), errors.camera_rms_px, errors.camera_ratio,
      errors.projector_rms_px, errors.projector_ratio, errors.centre_rms_px,
      errors.uncorrected_rms_px);
  EXPECT_LT(errors.camera_rms_px, 0.03);
  EXPECT_LT(errors.projector_rms_px, 0.02);
  EXPECT_LT(errors.centre_rms_px, 0.03);
  // Stated and true: 70 to 80 numbers, so within 17 % one standard deviation.
  EXPECT_LT(errors.camera_ratio, 2.0);
  EXPECT_LT(errors.projector_ratio, 2.0);
  EXPECT_GT(errors.camera_ratio, 0.5);
  EXPECT_GT(errors.projector_ratio, 0.4);
}

INSTANTIATE_TEST_SUITE_P(Kinds, RenderedTarget, testing::Values(true, false),
                         [](const auto& tested) {
                           return tested.param ? "ring_dots" : "chessboard";
                         });

/// Science 1.2: sigma >= (sigma_n / A) sqrt(2 s / (sqrt(pi) r)).
TEST(RenderedDots, AreCloseToTheBoundOfOneFrame) {
  CalibrationTarget target = RingDots();
  target.kind = TargetKind::kCircles;
  target.ring_radius_m = 0.0;
  target.print_ratio = 0.1;
  const Transform T_object_camera = sim::TargetView(MakeTargetPrint(target), 0.5, 0.1, 0.1, 0.1);
  const Rendered rendered = Render(target, T_object_camera);
  const Image<float> white = GreyPicture(rendered.stack.frames.front().pixels);
  const auto sighting = DetectTarget(white, target, {});
  ASSERT_TRUE(sighting) << sighting.error().message;
  const auto points = TargetPoints(target);
  double squares = 0.0;
  double bound = 0.0;
  for (const PointSighting& seen : sighting->points) {
    const Eigen::Vector3d& point = points[static_cast<std::size_t>(seen.point)];
    squares +=
        (seen.pixel_camera - ImagedCentre(rendered, point, target.dot_radius_m)).squaredNorm();
    const auto x = static_cast<int>(std::lround(seen.pixel_camera.x()));
    const auto y = static_cast<int>(std::lround(seen.pixel_camera.y()));
    const double radius_px = target.dot_radius_m * rendered.calibration.camera.fx /
                             (rendered.T_camera_target * point).z();
    const auto dark = static_cast<double>(white(x, y));
    const auto light = static_cast<double>(white(x, y + static_cast<int>(1.6 * radius_px)));
    const double variance = 1.0 + 0.05 * 0.5 * (dark + light) + 1.0 / 12.0;
    // The pixel's own width blurs too, and the softness of the print.
    const double softness_px = 1e-4 * radius_px / target.dot_radius_m;
    const double blur_px = std::sqrt(0.7 * 0.7 + 1.0 / 12.0 + softness_px * softness_px);
    bound +=
        variance / ((light - dark) * (light - dark)) * 2.0 * blur_px / (std::sqrt(kPi) * radius_px);
  }
  const auto count = static_cast<double>(sighting->points.size());
  const double ratio = std::sqrt(squares / (2.0 * count) / (bound / count));
  fmt::print("dots of one frame: rms {:.4f} px, {:.2f} of the bound\n",
             std::sqrt(squares / (2.0 * count)), ratio);
  EXPECT_LT(ratio, 1.5);
  EXPECT_GT(ratio, 0.7);
}

TEST(TransferToProjector, RefusesMapsThatDoNotServe) {
  const CalibrationTarget target = RenderedChessboard();
  TargetSighting sighting;
  for (int i = 0; i < 8; ++i) {
    PointSighting point;
    point.point = i + (i / 4) * 4;
    point.pixel_camera = Eigen::Vector2d(20.0 + 10.0 * (i % 4), 20.0 + 10.0 * (i / 4));
    sighting.points.push_back(point);
  }
  PhaseMap phase;
  phase.width = phase.height = 100;
  const auto said = [&] {
    const auto result = TransferToProjector(phase, sighting, target, {}, std::nullopt);
    return result ? std::string("no error") : result.error().message;
  };
  EXPECT_NE(said().find("only one axis"), std::string::npos) << said();
  phase.u = phase.v = phase.sigma_u = phase.sigma_v = Image<float>(100, 100, 1.0F);
  phase.mask = Image<std::uint8_t>(100, 100, static_cast<std::uint8_t>(MaskReason::kTooDark));
  EXPECT_NE(said().find("none of 8 target points"), std::string::npos) << said();
  phase.relative_u = true;
  EXPECT_NE(said().find("relative"), std::string::npos) << said();
  phase.relative_u = false;
  sighting.points.resize(3);
  EXPECT_NE(said().find("at least 4"), std::string::npos) << said();
}

/// A map that is a polynomial of second degree is carried over without error.
TEST(TransferToProjector, IsExactOnPolynomials) {
  CalibrationTarget target;
  target.kind = TargetKind::kCircles;
  target.num_columns = 3;
  target.num_rows = 3;
  target.pitch_m = 0.02;
  target.dot_radius_m = 0.004;
  TargetSighting sighting;
  for (int i = 0; i < 9; ++i) {
    PointSighting point;
    point.point = i;
    point.pixel_camera = Eigen::Vector2d(30.25 + 40.0 * (i % 3), 30.5 + 40.0 * (i / 3));
    sighting.points.push_back(point);
  }
  const auto u = [](double x, double y) { return 100.0 + 2.0 * x - 0.5 * y + 1e-3 * x * x; };
  const auto v = [](double x, double y) { return 50.0 + 1.5 * y + 2e-3 * x * y; };
  PhaseMap phase;
  phase.width = phase.height = 140;
  phase.u = phase.v = Image<float>(140, 140);
  phase.sigma_u = phase.sigma_v = Image<float>(140, 140, 0.05F);
  phase.mask = Image<std::uint8_t>(140, 140, 0);
  for (int y = 0; y < 140; ++y) {
    for (int x = 0; x < 140; ++x) {
      phase.u(x, y) = static_cast<float>(u(x, y));
      phase.v(x, y) = static_cast<float>(v(x, y));
      // Edges of the print spoil what lies within two pixels of them.
      const double dx = std::remainder(x - 30.25, 40.0);
      const double dy = std::remainder(y - 30.5, 40.0);
      if (std::abs(std::hypot(dx, dy) - 8.0) < 2.0) phase.u(x, y) += 1.0F;
    }
  }
  const auto result = TransferToProjector(phase, sighting, target, {}, std::nullopt);
  ASSERT_TRUE(result) << result.error().message;
  for (const PointSighting& point : result->points) {
    ASSERT_TRUE(point.has_projector);
    EXPECT_NEAR(point.pixel_projector.x(), u(point.pixel_camera.x(), point.pixel_camera.y()), 1e-3);
    EXPECT_NEAR(point.pixel_projector.y(), v(point.pixel_camera.x(), point.pixel_camera.y()), 1e-3);
    EXPECT_GT(point.covariance_projector_px2(0, 0), 0.0);
    EXPECT_LT(std::sqrt(point.covariance_projector_px2(0, 0)), 0.02);
  }
}

TEST(EvenlyLitPicture, AveragesWhatEvensOut) {
  ImageStack stack;
  stack.sequence.width = stack.sequence.height = 16;
  const auto add = [&](const Pattern& pattern, std::uint8_t value) {
    stack.sequence.frames.push_back(pattern);
    CapturedFrame frame;
    frame.pixels = Image<std::uint8_t>(4, 3, value);
    stack.frames.push_back(frame);
  };
  Pattern gray;
  gray.kind = PatternKind::kGray;
  add(Pattern{}, 200);
  add(gray, 60);
  gray.inverse = true;
  add(gray, 100);
  const auto even = EvenlyLitPicture(stack);
  ASSERT_TRUE(even) << even.error().message;
  EXPECT_EQ((*even)(2, 1), 80.0F);
  // A bit without its inverse does not even out: the white frame serves.
  stack.sequence.frames.pop_back();
  stack.frames.pop_back();
  const auto white = EvenlyLitPicture(stack);
  if (white) {
    EXPECT_EQ((*white)(2, 1), 200.0F);
  }
}

}  // namespace
}  // namespace fringe_fusion
