#include <gtest/gtest.h>

#include <cmath>

#include "fringe_fusion/geometry/camera_model.hpp"
#include "test/sim/scenes.hpp"

namespace fringe_fusion::sim {
namespace {

TEST(CellSetup, BothDevicesCoverTheWorkingVolume) {
  const CellCalibration calibration = DefaultCalibration();
  ASSERT_TRUE(Validate(calibration, "default"));
  EXPECT_NEAR(calibration.T_projector_camera.inverse().translation().norm(), 0.2, 0.01);
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d point((corner & 1) != 0 ? 0.06 : -0.06, (corner & 2) != 0 ? 0.06 : -0.06,
                                (corner & 4) != 0 ? 0.56 : 0.44);
    const Eigen::Vector2d camera = Project(calibration.camera, point);
    const Eigen::Vector2d projector =
        Project(calibration.projector, calibration.T_projector_camera * point);
    EXPECT_TRUE(camera.x() >= 0 && camera.x() <= 799 && camera.y() >= 0 && camera.y() <= 599)
        << camera.transpose();
    EXPECT_TRUE(projector.x() >= 0 && projector.x() <= 1279 && projector.y() >= 0 &&
                projector.y() <= 799)
        << projector.transpose();
  }
}

TEST(CellSetup, TurntablePoseLooksAtTheTarget) {
  const Eigen::Vector3d target(0.0, 0.0, 0.035);
  for (int k = 0; k < 5; ++k) {
    const Transform T = TurntablePose(k, 5, 0.5, 25.0, target);
    EXPECT_LT((T.inverse() * target - Eigen::Vector3d(0.0, 0.0, 0.5)).norm(), 1e-12);
    EXPECT_NEAR(T.translation().z(), 0.035 + 0.5 * std::sin(25.0 * M_PI / 180.0), 1e-12);
    EXPECT_NEAR(T.linear().determinant(), 1.0, 1e-12);
    // Up in the world is up in the picture: y of the camera points down.
    EXPECT_LT((T.linear().transpose() * Eigen::Vector3d::UnitZ()).y(), 0.0);
    EXPECT_NEAR((T.linear().transpose() * Eigen::Vector3d::UnitZ()).x(), 0.0, 1e-12);
  }
}

TEST(CellSetup, TheObjectTurnsCounterClockwise) {
  const Eigen::Vector3d target(0.0, 0.0, 0.02);
  const Transform first = TurntablePose(0, 8, 0.5, 30.0, target);
  const Transform next = TurntablePose(1, 8, 0.5, 30.0, target);
  const Eigen::Vector3d point(0.03, 0.01, 0.02);
  // Turned by 45 degrees about +z, the point is where the fixed camera saw R point before.
  const Eigen::Vector3d turned = ExpRotation({0.0, 0.0, M_PI / 4.0}) * point;
  EXPECT_LT((next.inverse() * point - first.inverse() * turned).norm(), 1e-12);
}

TEST(CellSetup, StatedCovarianceIsThatOfThePoseErrors) {
  SimConfig config;
  config.turntable_angle_sigma_deg = 0.05;
  config.turntable_shift_sigma_mm = 0.2;
  config.arm_rotation_sigma_deg = 0.02;
  config.arm_translation_sigma_mm = 0.1;
  SimCell cell = MakeCell(config, SmallScanner(100), MakePlane(0.01, 1));
  const Transform commanded = TurntablePose(1, 6, 0.5, 25.0, {0.0, 0.0, 0.03});
  const Matrix6d stated = PoseErrorCovariance(config, commanded);
  Matrix6d sample = Matrix6d::Zero();
  Vector6d mean = Vector6d::Zero();
  constexpr int kPoses = 3000;
  for (int i = 0; i < kPoses; ++i) {
    ASSERT_TRUE(cell.MoveTo(commanded, i));
    const Vector6d xi = Log(commanded.inverse() * cell.Truth().T_object_camera);
    sample += xi * xi.transpose() / kPoses;
    mean += xi / kPoses;
  }
  // Whitened, the sample covariance is the identity within its scatter.
  const Matrix6d root = stated.llt().matrixL();
  const Matrix6d whitened = root.inverse() * sample * root.inverse().transpose();
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      const double scatter = std::sqrt((i == j ? 2.0 : 1.0) / kPoses);
      EXPECT_NEAR(whitened(i, j), i == j ? 1.0 : 0.0, 4.5 * scatter) << i << " " << j;
    }
  }
  EXPECT_LT((root.inverse() * mean).norm(), 5.0 / std::sqrt(kPoses / 6.0));
}

TEST(CellSetup, ATurntableErrsAboutItsAxisOnly) {
  SimConfig config;
  config.turntable_angle_sigma_deg = 1.0;
  SimCell cell = MakeCell(config, SmallScanner(100), MakePlane(0.01, 1));
  const Transform commanded = TurntablePose(1, 6, 0.5, 25.0, {0.0, 0.0, 0.03});
  ASSERT_TRUE(cell.MoveTo(commanded, 4));
  const Transform T = cell.Truth().T_object_camera;
  const Transform error = T * commanded.inverse();
  EXPECT_GT(LogRotation(error.linear()).norm(), 1e-5);
  EXPECT_LT(error.translation().norm(), 1e-12);
  EXPECT_LT(LogRotation(error.linear()).head<2>().norm(), 1e-12);
  ASSERT_TRUE(cell.MoveTo(commanded, 5));
  EXPECT_GT((T.matrix() - cell.Truth().T_object_camera.matrix()).norm(), 1e-5);
  ASSERT_TRUE(cell.MoveTo(commanded, 4));
  EXPECT_EQ((T.matrix() - cell.Truth().T_object_camera.matrix()).norm(), 0.0);
}

TEST(CellSetup, CaptureStackFollowsTheSequence) {
  const CellCalibration calibration = SmallScanner(8);
  SimCell cell = MakeCell(SimConfig{}, calibration, MakePlane(0.4, 1));
  ASSERT_TRUE(cell.MoveTo(TopView(), 2));
  PatternConfig pattern;
  pattern.fringes = "1,8,32";  // The small projector has no room for 64.
  const Result<PatternSequence> sequence =
      MakeSequence(pattern, calibration.projector.width, calibration.projector.height);
  ASSERT_TRUE(sequence) << sequence.error().message;
  const Result<ImageStack> stack = CaptureStack(cell, *sequence, 1.0, 0.01, 2);
  ASSERT_TRUE(stack) << stack.error().message;
  EXPECT_TRUE(Validate(*stack, "stack"));
  EXPECT_EQ(stack->view_id, 2);
  EXPECT_EQ(stack->camera_id, "sim-camera");
  const auto& white = std::get<0>(stack->frames[0].pixels);
  const auto& black = std::get<0>(stack->frames[1].pixels);
  EXPECT_GT(white(50, 37), 40);
  EXPECT_EQ(black(50, 37), 0);
  EXPECT_EQ(stack->frames[1].stamp_ns - stack->frames[0].stamp_ns, 40000000);

  const Result<PatternSequence> other = MakeSequence(PatternConfig{}, 128, 128);
  EXPECT_FALSE(CaptureStack(cell, *other, 1.0, 0.01, 2));
  EXPECT_FALSE(CaptureStack(cell, PatternSequence{}, 1.0, 0.01, 2));
}

}  // namespace
}  // namespace fringe_fusion::sim
