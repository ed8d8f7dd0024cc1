#include "fringe_fusion/io/opencv_calibration.hpp"

#include <gtest/gtest.h>

#include "test/io/scan_fixture.hpp"
#include "test/support/data_path.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

TEST(OpenCvCalibration, ReadsSlstudio) {
  const std::string path = DataPath("slstudio/calibration/calibration.xml");
  FRINGE_FUSION_REQUIRE_DATA(path);
  const auto read = ReadOpenCvCalibration(path);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->camera.width, 1688);
  EXPECT_EQ(read->projector.height, 1140);
  EXPECT_NEAR(read->camera.fx, 2195.12036, 1e-3);
  EXPECT_NEAR(read->projector.cy, 1109.11121, 1e-3);
  EXPECT_NEAR(read->projector.distortion[0], -0.0314900056, 1e-9);
  EXPECT_NEAR(read->T_projector_camera.translation().x(), -0.145282562, 1e-8);
  EXPECT_NEAR(read->T_projector_camera.linear()(0, 1), -0.120346159, 1e-7);
  EXPECT_NEAR(read->rms_px, 0.42199749739974501, 1e-12);
  EXPECT_EQ(MessageOf(ReadOpenCvCalibration(path, {640, 480})),
            path + ": the camera has 1688 x 1352 pixels, not 640 x 480");
}

TEST(OpenCvCalibration, ReadsProcamCalibrationWithTheSizeOfItsProjector) {
  const std::string path = DataPath("kamino_procam/calibration_result.xml");
  FRINGE_FUSION_REQUIRE_DATA(path);
  EXPECT_EQ(MessageOf(ReadOpenCvCalibration(path)),
            path + ": does not state the size of the projector, give it");
  const auto read = ReadOpenCvCalibration(path, {}, {1024, 768});
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->camera.width, 1280);
  EXPECT_EQ(read->camera.height, 1024);
  EXPECT_EQ(read->projector.width, 1024);
  EXPECT_NEAR(read->projector.fy, 3893.2555903450616, 1e-9);
  EXPECT_NEAR(read->T_projector_camera.translation().y(), -0.63045718819563251, 1e-12);
}

TEST(OpenCvCalibration, ReadsSltk) {
  const std::string path = DataPath("sltk/procam_2016_12_09.yaml");
  FRINGE_FUSION_REQUIRE_DATA(path);
  const auto read = ReadOpenCvCalibration(path);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->camera.width, 2592);
  EXPECT_NEAR(read->projector.fy, 1719.2298865347213, 1e-9);
  EXPECT_NEAR(read->rms_px, 0.61888376087124664, 1e-12);
}

TEST(OpenCvCalibration, SaysWhatIsWrong) {
  const TempFolder folder;
  const std::string path = folder / "c.yaml";
  EXPECT_NE(MessageOf(ReadOpenCvCalibration(path)).find(path), std::string::npos);
  Spit(path, "hello");
  EXPECT_NE(MessageOf(ReadOpenCvCalibration(path)).find(path), std::string::npos);
  Spit(path, "%YAML:1.0\nKc: 3\nKp: 4\nframeWidth: 10\n");
  EXPECT_NE(MessageOf(ReadOpenCvCalibration(path)).find(path), std::string::npos);
}

}  // namespace
}  // namespace fringe_fusion
