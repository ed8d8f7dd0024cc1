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
  other.T_projector_camera.translation().x() += 1e-8;
  EXPECT_NE(id, CalibrationId(other));
  other = reference;
  other.T_projector_camera.rotate(Eigen::AngleAxisd(1e-8, Eigen::Vector3d::UnitZ()));
  EXPECT_NE(id, CalibrationId(other));
}

TEST(CellCalibration, IdSurvivesTheWayThroughTf) {
  const CellCalibration reference = sim::DefaultCalibration();
  CellCalibration other = reference;
  const Transform T_camera_projector = reference.T_projector_camera.inverse();
  const Eigen::Quaterniond q(T_camera_projector.linear());
  Transform rebuilt = Transform::Identity();
  rebuilt.linear() = q.normalized().toRotationMatrix();
  rebuilt.translation() = T_camera_projector.translation();
  other.T_projector_camera = rebuilt.inverse();
  ASSERT_NE(other.T_projector_camera.matrix(), reference.T_projector_camera.matrix());
  other.camera_serial = "A";
  EXPECT_EQ(CalibrationId(other), CalibrationId(reference));
}

}  // namespace
}  // namespace fringe_fusion
