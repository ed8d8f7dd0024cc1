#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <filesystem>

#include "fringe_fusion/calibration/sighting_from_scan.hpp"
#include "fringe_fusion/io/image_io.hpp"
#include "src/calibration/target_homography.hpp"
#include "test/support/data_path.hpp"

namespace fringe_fusion {
namespace {

using test_support::DataPath;

/// Rms distance of the points to a homography of the target [px]: lens distortion and the shift of
/// ellipse centres included, so an upper limit of the error of the detection.
double HomographyRms(const TargetSighting& sighting, const CalibrationTarget& target) {
  const auto homography = internal::FitTargetHomography(sighting, target);
  if (!homography) return 1e9;
  const auto points = TargetPoints(target);
  double squares = 0.0;
  for (const PointSighting& p : sighting.points) {
    const Eigen::Vector2d xy = points[static_cast<std::size_t>(p.point)].head<2>();
    squares += (homography->Map(xy) - p.pixel_camera).squaredNorm();
  }
  return std::sqrt(squares / static_cast<double>(sighting.points.size()));
}

CalibrationTarget Chessboard(int columns, int rows, double pitch_m) {
  CalibrationTarget target;
  target.num_columns = columns;
  target.num_rows = rows;
  target.pitch_m = pitch_m;
  return target;
}

Image<float> Mean(const std::vector<std::string>& files) {
  Image<float> mean;
  for (const std::string& file : files) {
    const auto pixels = ReadGrayImage(file);
    if (!pixels) throw std::runtime_error(pixels.error().message);
    const Image<float> grey = GreyPicture(*pixels);
    if (mean.empty()) mean = Image<float>(grey.width(), grey.height());
    for (std::size_t i = 0; i < grey.size(); ++i) {
      mean[i] += grey[i] / static_cast<float>(files.size());
    }
  }
  return mean;
}

TEST(DetectRealData, SeesEveryCornerOfSlstudio) {
  const std::string folder = DataPath("slstudio/calibration");
  FRINGE_FUSION_REQUIRE_DATA(folder);
  // The bad pose; bench/target_study sees the others.
  for (const int pose : {2}) {
    std::vector<std::string> files;
    for (int i = 0; i < 12; ++i) {
      files.push_back(fmt::format("{}/calseq{}/frameSeq_{:02d}.png", folder, pose, i));
    }
    const CalibrationTarget target = Chessboard(13, 9, 0.01);
    const auto sighting = DetectTarget(Mean(files), target, DetectConfig{});
    ASSERT_TRUE(sighting) << pose << ": " << sighting.error().message;
    EXPECT_EQ(sighting->points.size(), 117U) << pose;
    const double rms = HomographyRms(*sighting, target);
    fmt::print("slstudio {}: {} corners, homography rms {:.3f} px, sigma {:.4f} px\n", pose,
               sighting->points.size(), rms,
               std::sqrt(sighting->points[40].covariance_camera_px2(0, 0)));
    EXPECT_LT(rms, 1.0) << pose;
  }
}

TEST(DetectRealData, SeesEveryCornerOfKamino) {
  const std::string folder = DataPath("kamino_procam");
  FRINGE_FUSION_REQUIRE_DATA(folder);
  for (const int pose : {1, 2}) {
    const CalibrationTarget target = Chessboard(7, 9, 0.075);
    const auto sighting = DetectTarget(
        Mean({fmt::format("{}/capture_{}/graycode_40.png", folder, pose)}), target, DetectConfig{});
    ASSERT_TRUE(sighting) << pose << ": " << sighting.error().message;
    EXPECT_EQ(sighting->points.size(), 63U) << pose;
    const double rms = HomographyRms(*sighting, target);
    fmt::print("kamino {}: {} corners, homography rms {:.3f} px, sigma {:.4f} px\n", pose,
               sighting->points.size(), rms,
               std::sqrt(sighting->points[30].covariance_camera_px2(0, 0)));
    EXPECT_LT(rms, 1.0) << pose;
  }
}

TEST(DetectRealData, SeesTheDotsOfHandEye) {
  const std::string folder = DataPath("handeye_10x10/images");
  FRINGE_FUSION_REQUIRE_DATA(folder);
  CalibrationTarget target;
  target.kind = TargetKind::kCircles;
  target.num_columns = 10;
  target.num_rows = 10;
  target.pitch_m = 0.0254;
  target.dot_radius_m = 0.25 * target.pitch_m;
  target.marked_points = {0};
  target.marked_radius_m = 2.0 * target.dot_radius_m;
  for (const int pose : {2, 7}) {
    const auto sighting =
        DetectTarget(Mean({fmt::format("{}/{}.png", folder, pose)}), target, DetectConfig{});
    ASSERT_TRUE(sighting) << pose << ": " << sighting.error().message;
    EXPECT_GE(sighting->points.size(), 95U) << pose;
    EXPECT_FALSE(sighting->is_orientation_assumed);
    const double rms = HomographyRms(*sighting, target);
    fmt::print("handeye {}: {} dots, homography rms {:.3f} px, sigma {:.4f} px\n", pose,
               sighting->points.size(), rms,
               std::sqrt(sighting->points[40].covariance_camera_px2(0, 0)));
    EXPECT_LT(rms, 1.0) << pose;
  }
}

}  // namespace
}  // namespace fringe_fusion
