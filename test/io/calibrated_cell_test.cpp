#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <limits>

#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"
#include "test/io/scan_fixture.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

CellCalibrationResult Calibrated() {
  CellCalibrationResult result;
  result.calibration = sim::DefaultCalibration();
  result.verdict.words = "accepted: \"all\" of it";
  for (int row = 0; row < kNumCellParameters; ++row) {
    for (int column = 0; column <= row; ++column) {
      const double value = row == column ? row + 1.0 : 1.0 / (3.0 + row + column);
      result.covariance(row, column) = result.covariance(column, row) = value;
    }
  }
  return result;
}

TEST(CalibratedCell, CovarianceSurvivesBitByBit) {
  const TempFolder folder;
  const CellCalibrationResult result = Calibrated();
  ASSERT_TRUE(WriteCalibratedCell(result, folder / "cell.yaml"));
  const auto covariance = ReadCellCovariance(folder / "cell.yaml");
  ASSERT_TRUE(covariance) << covariance.error().message;
  EXPECT_EQ(*covariance, result.covariance);
  // The same file is an ordinary cell.yaml.
  const auto cell = ReadCellCalibration(folder / "cell.yaml");
  ASSERT_TRUE(cell) << cell.error().message;
  EXPECT_EQ(CalibrationId(*cell), CalibrationId(result.calibration));
}

TEST(CalibratedCell, SaysWhatIsWrongWithACovariance) {
  const TempFolder folder;
  ASSERT_TRUE(WriteCellCalibration(sim::DefaultCalibration(), folder / "plain.yaml"));
  EXPECT_EQ(MessageOf(ReadCellCovariance(folder / "plain.yaml")),
            folder / "plain.yaml" + ": states no covariance");
  Spit(folder / "short.yaml", Slurp(folder / "plain.yaml") + "covariance: [1, 2, 3]\n");
  const std::string said = MessageOf(ReadCellCalibration(folder / "short.yaml"));
  EXPECT_NE(said.find("covariance has 3 numbers, must have 300"), std::string::npos) << said;
  CellCalibrationResult result = Calibrated();
  result.covariance(3, 3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(WriteCalibratedCell(result, folder / "nan.yaml"));
}

TEST(UncalibratedScan, NeedsNoCalibration) {
  const TempFolder folder;
  auto scan = CreateScan(folder / "scan", AwkwardCalibration(), SmallSequence());
  ASSERT_TRUE(scan) << scan.error().message;
  EXPECT_EQ(MessageOf(OpenUncalibratedScan(folder / "scan")), folder / "scan" + ": has no views");
  ASSERT_TRUE(
      WriteStack(*scan, NoiseStack(scan->calibration, scan->sequence, 8, 3), std::nullopt, {}));
  std::filesystem::remove(folder / "scan/cell.yaml");
  const auto opened = OpenUncalibratedScan(folder / "scan");
  ASSERT_TRUE(opened) << opened.error().message;
  EXPECT_EQ(opened->calibration.camera.width, 40);
  EXPECT_EQ(opened->calibration.projector.height, 32);
  EXPECT_EQ(opened->view_ids, std::vector<int>{3});
  EXPECT_TRUE(ReadStack(*opened, 3));
  EXPECT_NE(MessageOf(OpenUncalibratedScan(folder / "none")).find("no such scan folder"),
            std::string::npos);
}

TEST(CameraInfo, IsWhatCameraInfoManagerReads) {
  const TempFolder folder;
  const CameraModel model = sim::DefaultCalibration().projector;
  ASSERT_TRUE(WriteCameraInfo(model, "projector", folder / "projector.yaml"));
  const YAML::Node root = YAML::LoadFile(folder / "projector.yaml");
  EXPECT_EQ(root["image_width"].as<int>(), model.width);
  EXPECT_EQ(root["camera_name"].as<std::string>(), "projector");
  EXPECT_EQ(root["distortion_model"].as<std::string>(), "plumb_bob");
  EXPECT_EQ(root["camera_matrix"]["data"][0].as<double>(), model.fx);
  EXPECT_EQ(root["camera_matrix"]["data"][5].as<double>(), model.cy);
  EXPECT_EQ(root["projection_matrix"]["data"].size(), 12U);
  EXPECT_EQ(root["distortion_coefficients"]["data"][1].as<double>(), model.distortion[1]);
  EXPECT_FALSE(WriteCameraInfo(CameraModel{}, "none", folder / "none.yaml"));
}

TEST(UtcDate, IsIso8601AndEmptyWithoutAStamp) {
  EXPECT_EQ(UtcDate(1700000000123456789), "2023-11-14T22:13:20Z");
  EXPECT_EQ(UtcDate(0), "");
}

}  // namespace
}  // namespace fringe_fusion
