#include "fringe_fusion/calibration/target.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <limits>

namespace fringe_fusion {
namespace {

CalibrationTarget Target(TargetKind kind) {
  CalibrationTarget target;
  target.kind = kind;
  target.num_columns = 4;
  target.num_rows = 3;
  target.pitch_m = 0.02;
  if (HasDots(kind)) target.dot_radius_m = 0.004;
  if (kind == TargetKind::kRingDots) target.ring_radius_m = 0.008;
  if (kind == TargetKind::kShiftedDots) target.num_shifts = 3;
  if (kind == TargetKind::kCharuco) target.marker_m = 0.015;
  return target;
}

TEST(CalibrationTarget, SquareLatticesRunRowAfterRow) {
  const auto points = TargetPoints(Target(TargetKind::kChessboard));
  ASSERT_EQ(points.size(), 12U);
  EXPECT_EQ(points[0], Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(points[3], Eigen::Vector3d(0.06, 0, 0));
  EXPECT_EQ(points[6], Eigen::Vector3d(0.04, 0.02, 0));
}

TEST(CalibrationTarget, AsymmetricRowsLieHalfAPitchApart) {
  const auto points = TargetPoints(Target(TargetKind::kAsymmetricCircles));
  EXPECT_EQ(points[4], Eigen::Vector3d(0.01, 0.01, 0));
  EXPECT_EQ(points[8], Eigen::Vector3d(0.0, 0.02, 0));
}

TEST(CalibrationTarget, ShiftedColumnsRepeatAfterTheirNumber) {
  const auto points = TargetPoints(Target(TargetKind::kShiftedDots));
  EXPECT_NEAR(points[1].y(), 0.02 / 3.0, 1e-15);
  EXPECT_NEAR(points[2].y(), 0.04 / 3.0, 1e-15);
  EXPECT_NEAR(points[3].y(), 0.0, 1e-15);
  EXPECT_NEAR(points[5].y(), 0.08 / 3.0, 1e-15);
}

TEST(CalibrationTarget, MarkedDotsHaveTheirOwnRadius) {
  CalibrationTarget target = Target(TargetKind::kCircles);
  target.marked_points = {0, 5};
  target.marked_radius_m = 0.006;
  ASSERT_TRUE(Validate(target, "t"));
  EXPECT_EQ(DotRadius(target, 5), 0.006);
  EXPECT_EQ(DotRadius(target, 6), 0.004);
}

TEST(CalibrationTarget, NamesOfKindsReadBack) {
  for (const TargetKind kind :
       {TargetKind::kChessboard, TargetKind::kCharuco, TargetKind::kCircles,
        TargetKind::kAsymmetricCircles, TargetKind::kRingDots, TargetKind::kShiftedDots}) {
    ASSERT_TRUE(TargetKindFromName(TargetKindName(kind)));
    EXPECT_EQ(*TargetKindFromName(TargetKindName(kind)), kind);
    EXPECT_TRUE(Validate(Target(kind), "t")) << TargetKindName(kind);
  }
  const auto wrong = TargetKindFromName("chess");
  ASSERT_FALSE(wrong);
  EXPECT_NE(wrong.error().message.find("'chess' must be one of chessboard"), std::string::npos);
}

TEST(CalibrationTarget, ValidateNamesWhatIsWrong) {
  struct Case {
    TargetKind kind;
    std::function<void(CalibrationTarget&)> spoil;
    const char* said;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Case> cases = {
      {TargetKind::kChessboard, [](auto& t) { t.num_columns = 1; }, "columns = 1 is outside"},
      {TargetKind::kChessboard, [](auto& t) { t.num_rows = 0; }, "rows = 0 is outside"},
      {TargetKind::kChessboard, [&](auto& t) { t.pitch_m = nan; }, "pitch_m = nan is outside"},
      {TargetKind::kChessboard, [](auto& t) { t.dot_radius_m = 1e-3; }, "means nothing"},
      {TargetKind::kChessboard, [](auto& t) { t.marked_points = {0}; }, "no dots to mark"},
      {TargetKind::kChessboard, [](auto& t) { t.num_shifts = 2; }, "num_shifts = 2 means nothing"},
      {TargetKind::kCircles, [](auto& t) { t.dot_radius_m = 0.011; }, "dot_radius_m = 0.011"},
      {TargetKind::kCircles, [](auto& t) { t.sigma_print_m = 0.01; }, "sigma_print_m = 0.01"},
      {TargetKind::kCircles, [](auto& t) { t.print_ratio = 1.0; }, "print_ratio = 1"},
      {TargetKind::kCharuco, [](auto& t) { t.marker_m = 0.02; }, "marker_m = 0.02"},
      {TargetKind::kCharuco, [](auto& t) { t.dictionary = 40; }, "dictionary = 40"},
      {TargetKind::kCharuco, [](auto& t) { t.num_columns = 60; }, "has 50 markers"},
      {TargetKind::kRingDots, [](auto& t) { t.ring_radius_m = 0.003; }, "ring_radius_m = 0.003"},
      {TargetKind::kShiftedDots, [](auto& t) { t.num_shifts = 1; }, "num_shifts = 1 is outside"},
      {TargetKind::kAsymmetricCircles, [](auto& t) { t.dot_radius_m = 0.0075; }, "dot_radius_m"},
  };
  for (const Case& c : cases) {
    CalibrationTarget target = Target(c.kind);
    c.spoil(target);
    const Status status = Validate(target, "target.yaml");
    ASSERT_FALSE(status) << c.said;
    EXPECT_NE(status.error().message.find(c.said), std::string::npos) << status.error().message;
    EXPECT_EQ(status.error().message.rfind("target.yaml: ", 0), 0U) << status.error().message;
  }
}

TEST(CalibrationTarget, ValidateRefusesMarksThatDoNotTell) {
  CalibrationTarget target = Target(TargetKind::kCircles);
  target.marked_points = {0};
  target.marked_radius_m = 0.0042;
  EXPECT_FALSE(Validate(target, "t"));
  target.marked_radius_m = 0.006;
  EXPECT_TRUE(Validate(target, "t"));
  target.marked_points = {0, 12};
  EXPECT_FALSE(Validate(target, "t"));
  target.marked_points = {3, 3};
  EXPECT_FALSE(Validate(target, "t"));
}

}  // namespace
}  // namespace fringe_fusion
