#include <gtest/gtest.h>

#include "test/io/scan_fixture.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

TEST(CellYaml, SurvivesARoundTripBitByBit) {
  const TempFolder folder;
  const CellCalibration calibration = AwkwardCalibration();
  ASSERT_TRUE(WriteCellCalibration(calibration, folder / "cell.yaml"));
  const auto read = ReadCellCalibration(folder / "cell.yaml");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(CalibrationId(*read), CalibrationId(calibration));
  EXPECT_EQ(read->T_projector_camera.matrix(), calibration.T_projector_camera.matrix());
  EXPECT_EQ(read->projector.distortion, calibration.projector.distortion);
  EXPECT_EQ(read->camera_serial, calibration.camera_serial);
  EXPECT_EQ(read->date, calibration.date);
  EXPECT_EQ(read->rms_px, calibration.rms_px);
  const std::string first = Slurp(folder / "cell.yaml");
  ASSERT_TRUE(WriteCellCalibration(*read, folder / "cell.yaml"));
  EXPECT_EQ(Slurp(folder / "cell.yaml"), first);
}

TEST(CellYaml, ReadsTheDocumentedForm) {
  const TempFolder folder;
  Spit(folder / "cell.yaml",
       "camera: {width: 10, height: 8, fx: 9, fy: 9, cx: 5, cy: 4, distortion: [0, 0, 0, 0, 0]}\n"
       "projector: {width: 20, height: 16, fx: 9, fy: 9, cx: 5, cy: 4, distortion: [1, 2, 3, 4, "
       "5]}\n"
       "T_projector_camera: {translation_m: [0.1, 0, 0], quaternion_xyzw: [0, 0, 1, 0]}\n");
  const auto read = ReadCellCalibration(folder / "cell.yaml");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->projector.distortion[4], 5.0);
  // Half a turn about z: x and y change sign, then the translation is added.
  const Eigen::Vector3d p = read->T_projector_camera * Eigen::Vector3d(1, 2, 3);
  EXPECT_NEAR((p - Eigen::Vector3d(-0.9, -2, 3)).norm(), 0.0, 1e-15);
}

TEST(CellYaml, NamesFileFieldAndValueOfEveryFault) {
  const TempFolder folder;
  const std::string path = folder / "cell.yaml";
  ASSERT_TRUE(WriteCellCalibration(AwkwardCalibration(), path));
  const std::string good = Slurp(path);
  const auto complaint = [&](const std::string& from, const std::string& to) {
    Spit(path, Replaced(good, from, to));
    return MessageOf(ReadCellCalibration(path));
  };
  EXPECT_EQ(complaint("fy: 17.1", "fy: .nan"), path + ": camera: fy = .nan must be finite");
  EXPECT_EQ(complaint("fy: 17.1, ", ""), path + ": camera: required key 'fy' is missing");
  EXPECT_EQ(complaint("fy: 17.1", "fy: 17.1, skew: 0"), path + ": camera: unknown key 'skew'");
  EXPECT_EQ(complaint("date", "day"), path + ": unknown key 'day'");
  EXPECT_EQ(complaint("projector:", "beamer:"), path + ": required key 'projector' is missing");
  EXPECT_EQ(complaint("1e-17", ".inf").rfind(path + ": projector: distortion = ", 0), 0U);
  const std::string size = complaint("width: 64", "width: 0");
  EXPECT_EQ(size.rfind(path + ": projector: ", 0), 0U) << size;
  EXPECT_NE(size.find("0 x 32"), std::string::npos) << size;
  EXPECT_NE(
      complaint("translation_m: [", "translation_m: [0, ").find("must be a list of 3 numbers"),
      std::string::npos);
  EXPECT_NE(complaint("quaternion_xyzw: [", "quaternion_xyzw: [1").find("quaternion has length"),
            std::string::npos);
  EXPECT_EQ(MessageOf(ReadCellCalibration(folder / "no.yaml")),
            (folder / "no.yaml") + ": cannot be read: No such file or directory");
}

TEST(CellYaml, RefusesToWriteAnInvalidCalibration) {
  const TempFolder folder;
  CellCalibration calibration = AwkwardCalibration();
  calibration.camera.fx = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(MessageOf(WriteCellCalibration(calibration, folder / "cell.yaml")), "");
  EXPECT_FALSE(std::ifstream(folder / "cell.yaml"));
}

}  // namespace
}  // namespace fringe_fusion
