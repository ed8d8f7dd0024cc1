#include "fringe_fusion/calibration/cell_calibration.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "fringe_fusion/sim/sim_cell.hpp"

namespace fringe_fusion {
namespace {

TEST(CellCalibration, ValidateAcceptsTheDefaultScanner) {
  EXPECT_TRUE(Validate(sim::DefaultCalibration(), "cell.yaml"));
}

TEST(CellCalibration, ValidateNamesTheDevice) {
  CellCalibration calibration = sim::DefaultCalibration();
  calibration.projector.width = 0;
  const Status status = Validate(calibration, "cell.yaml");
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("cell.yaml: projector: size 0"), std::string::npos);
}

TEST(CellCalibration, ValidateRefusesBadBaselines) {
  CellCalibration calibration = sim::DefaultCalibration();
  calibration.T_projector_camera.translation().setZero();
  EXPECT_FALSE(Validate(calibration, "cell.yaml"));
  calibration.T_projector_camera.translation().setConstant(
      std::numeric_limits<double>::quiet_NaN());
  EXPECT_FALSE(Validate(calibration, "cell.yaml"));
}

TEST(CellCalibration, IdFollowsEveryNumber) {
  const CellCalibration reference = sim::DefaultCalibration();
  const std::string id = CalibrationId(reference);
  EXPECT_EQ(id.size(), 16U);
  EXPECT_EQ(id, CalibrationId(sim::DefaultCalibration()));
  CellCalibration other = reference;
  other.camera.distortion[3] += 1e-12;
  EXPECT_NE(id, CalibrationId(other));
  other = reference;
  other.projector.cy += 1e-9;
  EXPECT_NE(id, CalibrationId(other));
  other = reference;
  other.T_projector_camera.translation().x() += 1e-12;
  EXPECT_NE(id, CalibrationId(other));
  other = reference;
  other.camera_serial = "B";
  EXPECT_NE(id, CalibrationId(other));
  // The joint of two texts counts: ("A", "B") is not ("AB", "").
  CellCalibration first = reference;
  first.camera_serial = "A";
  first.projector_serial = "B";
  CellCalibration second = reference;
  second.camera_serial = "AB";
  second.projector_serial = "";
  EXPECT_NE(CalibrationId(first), CalibrationId(second));
}

}  // namespace
}  // namespace fringe_fusion
