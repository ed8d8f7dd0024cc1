#include "fringe_fusion/inspection/calibration_report.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/image_io.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using test_support::TempFolder;

bool IsGreyOf(const Rgb8& c, int low, int high) {
  return c.r == c.g && c.g == c.b && c.r >= low && c.r <= high;
}

/// Three points of one pose in the camera, one in the projector; numbers are made up.
CellCalibrationResult SmallResult() {
  CellCalibrationResult result;
  result.calibration.camera = {640, 480, 800.0, 800.0, 319.5, 239.5, {}};
  result.calibration.projector = {1280, 800, 1600.0, 1600.0, 639.5, 399.5, {}};
  result.calibration.T_projector_camera = Transform(Eigen::Translation3d(-0.2, 0.0, 0.0));
  result.covariance(0, 0) = result.covariance(1, 1) = 0.25;
  result.rms_camera_px = 0.08;
  result.rms_projector_px = 0.5;
  PoseOutcome pose;
  pose.name = "pose <0>";
  pose.used = true;
  pose.T_camera_target = Transform(Eigen::Translation3d(0.0, 0.0, 0.5));
  pose.num_points_camera = 3;
  pose.rms_camera_px = 0.05;
  PoseOutcome left_out;
  left_out.name = "pose 1";
  left_out.reason = "mirrored";
  result.poses = {pose, left_out};
  result.target_points = {{-0.05, -0.05, 0.0}, {0.05, -0.05, 0.05}, {0.05, 0.05, 0.0}};
  result.stage_shifts_m.assign(2, Eigen::Vector3d::Zero());
  result.residuals = {{0, 0, false, {40.0, 40.0}, {0.1, 0.0}},
                      {0, 1, false, {600.0, 40.0}, {0.0, -0.05}},
                      {0, 2, false, {600.0, 440.0}, {0.0, 0.0}},
                      {0, 0, true, {640.0, 400.0}, {0.5, 0.5}}};
  result.rejected = {{0, 2, true, 1.25, 7.5}};
  result.coverage.camera_ratio = 3.0 / 48.0;
  result.verdict.words = "accepted: a < b";
  result.next.words = "place the target nearer";
  return result;
}

TEST(DrawResidualScatter, PutsTheResidualWhereItIs) {
  const Image<Rgb8> picture = DrawResidualScatter(SmallResult(), false);
  const int middle = picture.width() / 2;
  // The largest residual, +0.1 px along x, lies at 1 / 1.05 of the way to the right margin.
  const int right = middle + static_cast<int>(std::lround((middle - 20) / 1.05));
  EXPECT_LT(picture(right, middle).r, 80) << "a dot of the first pose's blue";
  EXPECT_GT(picture(right, middle).b, 140);
  // -0.05 px along y: half as far, upwards.
  const int up = middle - (right - middle) / 2;
  EXPECT_GT(picture(middle, up).b, picture(middle, up).r + 60);
  // No residual to the left.
  EXPECT_TRUE(IsGreyOf(picture(middle - (right - middle), middle + 8), 255, 255));
}

TEST(DrawResidualField, ShadesCellsWithoutPointsAndDrawsResiduals) {
  const Image<Rgb8> picture = DrawResidualField(SmallResult(), false);
  EXPECT_EQ(picture.width(), 720);
  EXPECT_EQ(picture.height(), 540 + 24);
  const auto in_cell = [&](int column, int row) {
    return picture(720 * column / 8 + 70, 540 * row / 6 + 80);
  };
  EXPECT_TRUE(IsGreyOf(in_cell(0, 0), 255, 255));
  EXPECT_TRUE(IsGreyOf(in_cell(7, 5), 255, 255));
  EXPECT_FALSE(IsGreyOf(in_cell(3, 3), 0, 255)) << "an empty cell is shaded";
  EXPECT_FALSE(IsGreyOf(in_cell(7, 2), 0, 255));
  // 0.1 px enlarged 200 times (at most a sixteenth of 640 px) ends 20 px beside (40, 40).
  const double scale = 720.0 / 640.0;
  const auto at = [&](double x, double y) {
    return picture(static_cast<int>(std::lround(scale * (x + 0.5))),
                   static_cast<int>(std::lround(scale * (y + 0.5))));
  };
  EXPECT_GT(at(55.0, 40.0).b, at(55.0, 40.0).r + 40);
  EXPECT_TRUE(IsGreyOf(at(66.0, 40.0), 255, 255));
}

TEST(DrawErrorSlices, IsRedWhereTheErrorIsLargest) {
  ErrorField field;
  field.volume = {{-0.1, -0.1, 0.4}, {0.1, 0.1, 0.6}};
  field.num = {2, 2, 1};
  for (int i = 0; i < 4; ++i) {
    PointError error;
    error.calibration.diagonal() = Eigen::Vector3d(i == 1 ? 1e-8 : 1e-14, 1e-14, 1e-14);
    field.errors.emplace_back(error);
  }
  field.errors[3].reset();
  const Image<Rgb8> picture = DrawErrorSlices(field);
  // Panels of 220 px from (84, 28): upper right of the first is the large X error, the lower right
  // is not seen.
  EXPECT_GT(picture(84 + 165, 28 + 55).r, picture(84 + 165, 28 + 55).b + 80);
  EXPECT_LT(picture(84 + 55, 28 + 55).r, 90);
  EXPECT_TRUE(IsGreyOf(picture(84 + 165, 28 + 165), 140, 160));
}

TEST(CalibrationReport, HoldsEveryTableAndPicture) {
  const TempFolder folder;
  const Status status =
      WriteCalibrationReport(SmallResult(), {"view 007: no target"}, folder.path());
  ASSERT_TRUE(status) << status.error().message;
  const std::string page = *ReadFile(folder / "report.html");
  for (const char* text :
       {"accepted: a &lt; b", "place the target nearer",
        "<td>camera fx</td><td>800.00</td><td>0.50</td><td>px</td>",
        "<td>projector cy</td><td>399.5</td><td>not estimated</td><td>px</td>",
        "<td>T_projector_camera translation x</td><td>-0.2</td><td>not estimated</td><td>m</td>",
        "pose &lt;0&gt;", "<td>mirrored</td>", "view 007: no target",
        "<td>projector</td><td>1.250</td><td>7.5</td>",
        "Predicted error of a point from the calibration alone"}) {
    EXPECT_NE(page.find(text), std::string::npos) << text;
  }
  for (const char* file : {"residuals_camera.png", "residuals_projector.png", "coverage_camera.png",
                           "coverage_projector.png", "error_field.png"}) {
    EXPECT_NE(page.find(std::string("<img src=\"") + file), std::string::npos) << file;
    EXPECT_TRUE(ReadColorImage(folder / file)) << file;
  }
  const Status nowhere = WriteCalibrationReport(SmallResult(), {}, folder / "none");
  ASSERT_FALSE(nowhere);
  EXPECT_NE(nowhere.error().message.find("none/residuals_camera.png"), std::string::npos);
}

}  // namespace
}  // namespace fringe_fusion
