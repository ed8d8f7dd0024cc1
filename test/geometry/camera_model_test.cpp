#include "fringe_fusion/geometry/camera_model.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <random>
#include <vector>

namespace fringe_fusion {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

CameraModel WideCamera() {
  CameraModel model;
  model.width = 1280;
  model.height = 1024;
  model.fx = 1100.0;
  model.fy = 1090.0;
  model.cx = 655.0;
  model.cy = 498.0;
  model.distortion = {-0.21, 0.11, 1.2e-3, -0.8e-3, -0.03};
  return model;
}

std::vector<Eigen::Vector3d> RandomPoints(int count) {
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> side(-0.45, 0.45);
  std::uniform_real_distribution<double> depth(0.4, 1.2);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const double z = depth(generator);
    points.emplace_back(z * side(generator), z * side(generator), z);
  }
  return points;
}

// The same lens model as OpenCV's, so that its calibrations can be used as they are.
TEST(CameraModel, ProjectsAsOpenCv) {
  const CameraModel model = WideCamera();
  const std::vector<Eigen::Vector3d> points = RandomPoints(500);
  std::vector<cv::Point3d> points_cv;
  for (const Eigen::Vector3d& p : points) points_cv.emplace_back(p.x(), p.y(), p.z());
  const cv::Mat K =
      (cv::Mat_<double>(3, 3) << model.fx, 0.0, model.cx, 0.0, model.fy, model.cy, 0.0, 0.0, 1.0);
  const cv::Mat distortion(1, 5, CV_64F, const_cast<double*>(model.distortion.data()));
  const cv::Mat zero = cv::Mat::zeros(3, 1, CV_64F);
  std::vector<cv::Point2d> pixels;
  cv::projectPoints(points_cv, zero, zero, K, distortion, pixels);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d pixel = Project(model, points[i]);
    EXPECT_NEAR(pixel.x(), pixels[i].x, 1e-9);
    EXPECT_NEAR(pixel.y(), pixels[i].y, 1e-9);
  }
}

TEST(CameraModel, UndistortInvertsProject) {
  const CameraModel model = WideCamera();
  for (const Eigen::Vector3d& point : RandomPoints(500)) {
    const Eigen::Vector2d back = Undistort(model, Project(model, point));
    EXPECT_LT((back - point.head<2>() / point.z()).norm(), 1e-12);
  }
}

TEST(CameraModel, JacobianIsTheDerivative) {
  const CameraModel model = WideCamera();
  for (const Eigen::Vector3d& point : RandomPoints(50)) {
    const Projection projection = ProjectWithJacobian(model, point);
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = 1e-6 * Eigen::Vector3d::Unit(axis);
      const Eigen::Vector2d slope =
          (Project(model, point + step) - Project(model, point - step)) / 2e-6;
      EXPECT_LT((projection.jacobian.col(axis) - slope).norm(), 1e-4 * slope.norm() + 1e-4);
    }
  }
}

TEST(CameraModel, BehindTheDeviceIsNan) {
  const CameraModel model = WideCamera();
  EXPECT_TRUE(Project(model, {0.1, 0.1, 0.0}).array().isNaN().all());
  EXPECT_TRUE(Project(model, {0.1, 0.1, -1.0}).array().isNaN().all());
  EXPECT_TRUE(Project(model, {0.1, 0.1, kNan}).array().isNaN().all());
}

TEST(CameraModel, UndistortBeyondTheFoldIsNan) {
  CameraModel model = WideCamera();
  model.distortion = {-0.5, 0.0, 0.0, 0.0, 0.0};
  // x (1 - x^2 / 2) peaks at x = 0.816 with 0.544: no ray reaches 0.7.
  const Eigen::Vector2d pixel(model.cx + 0.7 * model.fx, model.cy);
  EXPECT_TRUE(Undistort(model, pixel).array().isNaN().all());
  EXPECT_TRUE(Undistort(model, {kNan, 0.0}).array().isNaN().all());
}

TEST(CameraModel, ValidateNamesTheField) {
  EXPECT_TRUE(Validate(WideCamera(), "camera"));
  CameraModel model = WideCamera();
  model.width = 0;
  EXPECT_NE(Validate(model, "cell.yaml: camera").error().message.find("cell.yaml: camera: size 0"),
            std::string::npos);
  model = WideCamera();
  model.fy = kNan;
  EXPECT_FALSE(Validate(model, "camera"));
  model = WideCamera();
  model.cx = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(Validate(model, "camera"));
  model = WideCamera();
  model.distortion[4] = kNan;
  EXPECT_FALSE(Validate(model, "camera"));
}

}  // namespace
}  // namespace fringe_fusion
