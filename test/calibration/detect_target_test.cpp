#include "fringe_fusion/calibration/detect_target.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "fringe_fusion/calibration/transfer_target.hpp"
#include "fringe_fusion/io/config_yaml.hpp"
#include "target_picture.hpp"

namespace fringe_fusion {
namespace {

using test_support::DrawTarget;
using test_support::TargetToPixel;

constexpr int kWidth = 640;
constexpr int kHeight = 480;

CalibrationTarget TargetOf(TargetKind kind, int columns, int rows) {
  CalibrationTarget target;
  target.kind = kind;
  target.num_columns = columns;
  target.num_rows = rows;
  target.pitch_m = 0.02;
  if (HasDots(kind)) target.dot_radius_m = 0.005;
  if (kind == TargetKind::kRingDots) {
    target.ring_radius_m = 0.0095;
    target.print_ratio = 0.45;
  }
  if (kind == TargetKind::kShiftedDots) target.num_shifts = 4;
  if (kind == TargetKind::kCharuco) target.marker_m = 0.014;
  return target;
}

/// Camera before the target: moved sideways by a shift of the target [m].
Eigen::Matrix3d Homography(const CalibrationTarget& target, double roll_rad,
                           const Eigen::Vector2d& shift_m = Eigen::Vector2d::Zero()) {
  const TargetPrint print = MakeTargetPrint(target);
  Transform T_object_camera = sim::TargetView(print, 0.5, 0.35, -0.25, roll_rad);
  T_object_camera.translation().head<2>() += shift_m;
  return TargetToPixel(kWidth, kHeight, 1000.0, T_object_camera);
}

/// Largest distance of the true centres to where they were drawn [px].
double LargestError(const TargetSighting& sighting, const CalibrationTarget& target,
                    const Eigen::Matrix3d& H) {
  const auto points = TargetPoints(target);
  const auto centres = TrueCentres(sighting, target);
  double largest = 0.0;
  for (std::size_t i = 0; i < centres.size(); ++i) {
    const Eigen::Vector3d& point = points[static_cast<std::size_t>(sighting.points[i].point)];
    const Eigen::Vector2d truth = (H * Eigen::Vector3d(point.x(), point.y(), 1.0)).hnormalized();
    largest = std::max(largest, (centres[i] - truth).norm());
  }
  return largest;
}

std::string MessageOf(const Result<TargetSighting>& result) {
  return result ? "no error" : result.error().message;
}

class EveryKind : public testing::TestWithParam<TargetKind> {};

TEST_P(EveryKind, IsFoundAtAnyRoll) {
  CalibrationTarget target = TargetOf(GetParam(), 8, 7);
  if (GetParam() == TargetKind::kCircles || GetParam() == TargetKind::kRingDots) {
    target.marked_points = {27, 28, 43};
    target.marked_radius_m = 0.007;
  }
  for (const double roll : {0.7, 3.0}) {
    const Eigen::Matrix3d H = Homography(target, roll);
    const auto sighting = DetectTarget(DrawTarget(target, H, kWidth, kHeight), target, {});
    ASSERT_TRUE(sighting) << TargetKindName(GetParam()) << " " << roll << ": "
                          << MessageOf(sighting);
    EXPECT_EQ(sighting->points.size(), 56U) << TargetKindName(GetParam()) << " " << roll;
    EXPECT_EQ(sighting->is_ellipse_centre, HasDots(GetParam()));
    // Noise-free: what is left is the drawing, a box for a pixel.
    if (!sighting->is_orientation_assumed) {
      EXPECT_LT(LargestError(*sighting, target, H), 0.02) << TargetKindName(GetParam()) << roll;
    }
    for (const PointSighting& p : sighting->points) {
      EXPECT_GT(p.covariance_camera_px2.determinant(), 0.0);
      EXPECT_LT(p.covariance_camera_px2.trace(), 1e-2);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, EveryKind,
                         testing::Values(TargetKind::kChessboard, TargetKind::kCharuco,
                                         TargetKind::kCircles, TargetKind::kAsymmetricCircles,
                                         TargetKind::kRingDots, TargetKind::kShiftedDots),
                         [](const auto& tested) { return TargetKindName(tested.param); });

TEST(DetectTarget, SaysWhereTheOrientationIsAConvention) {
  const CalibrationTarget circles = TargetOf(TargetKind::kCircles, 8, 7);
  const Eigen::Matrix3d H = Homography(circles, 3.0);
  const auto turned = DetectTarget(DrawTarget(circles, H, kWidth, kHeight), circles, {});
  ASSERT_TRUE(turned) << MessageOf(turned);
  EXPECT_TRUE(turned->is_orientation_assumed);
  // By convention x runs to the right.
  EXPECT_LT(turned->points[0].pixel_camera.x(), turned->points[7].pixel_camera.x());
  // An odd number of corners on one side shows which way a chessboard lies.
  const CalibrationTarget board = TargetOf(TargetKind::kChessboard, 8, 7);
  const auto known = DetectTarget(DrawTarget(board, H, kWidth, kHeight), board, {});
  ASSERT_TRUE(known) << MessageOf(known);
  EXPECT_FALSE(known->is_orientation_assumed);
}

TEST(DetectTarget, TakesPartsThatAreMarked) {
  for (const TargetKind kind : {TargetKind::kCharuco, TargetKind::kCircles}) {
    CalibrationTarget target = TargetOf(kind, 8, 7);
    if (kind == TargetKind::kCircles) {
      target.marked_points = {27, 28, 43};
      target.marked_radius_m = 0.007;
    }
    const Eigen::Matrix3d H = Homography(target, 0.2, Eigen::Vector2d(0.12, -0.08));
    const auto sighting = DetectTarget(DrawTarget(target, H, kWidth, kHeight), target, {});
    ASSERT_TRUE(sighting) << TargetKindName(kind) << MessageOf(sighting);
    EXPECT_LT(sighting->points.size(), 54U);
    EXPECT_GT(sighting->points.size(), 25U);
    EXPECT_LT(LargestError(*sighting, target, H), 0.02);
  }
}

TEST(DetectTarget, RefusesPartsThatMayLieAnywhere) {
  for (const TargetKind kind : {TargetKind::kChessboard, TargetKind::kCircles}) {
    const CalibrationTarget target = TargetOf(kind, 8, 7);
    const Eigen::Matrix3d H = Homography(target, 0.2, Eigen::Vector2d(0.12, -0.08));
    const auto sighting = DetectTarget(DrawTarget(target, H, kWidth, kHeight), target, {});
    ASSERT_FALSE(sighting);
    EXPECT_NE(MessageOf(sighting).find("nothing marks which"), std::string::npos)
        << MessageOf(sighting);
  }
}

TEST(DetectTarget, TellsAnotherSize) {
  const CalibrationTarget shown = TargetOf(TargetKind::kChessboard, 9, 7);
  const CalibrationTarget stated = TargetOf(TargetKind::kChessboard, 7, 6);
  const auto sighting =
      DetectTarget(DrawTarget(shown, Homography(shown, 0.1), kWidth, kHeight), stated, {});
  ASSERT_FALSE(sighting);
  EXPECT_NE(MessageOf(sighting).find("shows 9 x 7 points"), std::string::npos)
      << MessageOf(sighting);
}

TEST(DetectTarget, TellsSwappedColumnsAndRows) {
  const CalibrationTarget shown = TargetOf(TargetKind::kAsymmetricCircles, 4, 11);
  CalibrationTarget stated = shown;
  std::swap(stated.num_columns, stated.num_rows);
  const auto sighting =
      DetectTarget(DrawTarget(shown, Homography(shown, 0.1), kWidth, kHeight), stated, {});
  ASSERT_FALSE(sighting);
  EXPECT_NE(MessageOf(sighting).find("columns and rows are swapped"), std::string::npos)
      << MessageOf(sighting);
}

TEST(DetectTarget, TellsAMirroredPrint) {
  for (const TargetKind kind :
       {TargetKind::kCharuco, TargetKind::kCircles, TargetKind::kShiftedDots}) {
    CalibrationTarget target = TargetOf(kind, 8, 7);
    if (kind == TargetKind::kCircles) {
      target.marked_points = {27, 28, 43};
      target.marked_radius_m = 0.007;
    }
    const auto sighting = DetectTarget(
        DrawTarget(target, Homography(target, 0.1), kWidth, kHeight, true), target, {});
    ASSERT_FALSE(sighting) << TargetKindName(kind);
    EXPECT_NE(MessageOf(sighting).find("mirrored"), std::string::npos)
        << TargetKindName(kind) << MessageOf(sighting);
  }
}

TEST(DetectTarget, LightDotsOnADarkGround) {
  CalibrationTarget target = TargetOf(TargetKind::kCircles, 8, 7);
  target.light_on_dark = true;
  const Eigen::Matrix3d H = Homography(target, 0.1);
  const auto sighting = DetectTarget(DrawTarget(target, H, kWidth, kHeight), target, {});
  ASSERT_TRUE(sighting) << MessageOf(sighting);
  EXPECT_EQ(sighting->points.size(), 56U);
}

TEST(DetectTarget, RefusesPicturesWithoutATarget) {
  const CalibrationTarget target = TargetOf(TargetKind::kChessboard, 8, 7);
  EXPECT_NE(MessageOf(DetectTarget(Image<float>(), target, {})).find("empty"), std::string::npos);
  Image<float> picture(kWidth, kHeight, 100.0F);
  EXPECT_NE(MessageOf(DetectTarget(picture, target, {})).find("blank"), std::string::npos);
  picture(10, 10) = 200.0F;
  EXPECT_NE(MessageOf(DetectTarget(picture, target, {})).find("no lattice of corners"),
            std::string::npos);
  picture(20, 20) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_NE(MessageOf(DetectTarget(picture, target, {})).find("not finite"), std::string::npos);
  DetectConfig config;
  config.max_aspect_ratio = 0.0;
  EXPECT_NE(MessageOf(DetectTarget(picture, target, config)).find("max_aspect_ratio = 0"),
            std::string::npos);
}

TEST(DetectTarget, ConfigFilesStateTheDefaults) {
  const auto detect = LoadConfigFile<DetectConfig>(SOURCE_DIR "/config/detect.yaml");
  ASSERT_TRUE(detect) << detect.error().message;
  EXPECT_EQ(detect->max_residual_ratio, DetectConfig{}.max_residual_ratio);
  EXPECT_EQ(detect->min_points_ratio, DetectConfig{}.min_points_ratio);
  const auto transfer = LoadConfigFile<TransferConfig>(SOURCE_DIR "/config/transfer.yaml");
  ASSERT_TRUE(transfer) << transfer.error().message;
  EXPECT_EQ(transfer->edge_guard_px, TransferConfig{}.edge_guard_px);
  EXPECT_EQ(transfer->max_sigma_px, TransferConfig{}.max_sigma_px);
}

}  // namespace
}  // namespace fringe_fusion
