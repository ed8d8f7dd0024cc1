#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <random>

#include "test/sim/scenes.hpp"

namespace fringe_fusion::sim {
namespace {

// Camera pixel -> plane -> projector pixel by OpenCV's lens model alone.
class OpenCvChain {
 public:
  OpenCvChain(const CellCalibration& calibration, const Transform& T_object_camera)
      : calibration_(calibration), T_object_camera_(T_object_camera) {}

  [[nodiscard]] Eigen::Vector3d PointCamera(int x, int y) const {
    std::vector<cv::Point2d> undistorted;
    cv::undistortPoints(
        std::vector<cv::Point2d>{{static_cast<double>(x), static_cast<double>(y)}}, undistorted,
        Matrix(calibration_.camera), Distortion(calibration_.camera), cv::noArray(), cv::noArray(),
        cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-14));
    const Eigen::Vector3d ray(undistorted[0].x, undistorted[0].y, 1.0);
    return -T_object_camera_.translation().z() / (T_object_camera_.linear() * ray).z() * ray;
  }

  [[nodiscard]] Eigen::Vector2d ProjectorPixel(const Eigen::Vector3d& point_camera) const {
    const Eigen::Matrix3d R = calibration_.T_projector_camera.linear();
    const Eigen::Vector3d t = calibration_.T_projector_camera.translation();
    const cv::Mat rotation = (cv::Mat_<double>(3, 3) << R(0, 0), R(0, 1), R(0, 2), R(1, 0), R(1, 1),
                              R(1, 2), R(2, 0), R(2, 1), R(2, 2));
    cv::Mat rotation_vector;
    cv::Rodrigues(rotation, rotation_vector);
    std::vector<cv::Point2d> pixels;
    cv::projectPoints(
        std::vector<cv::Point3d>{{point_camera.x(), point_camera.y(), point_camera.z()}},
        rotation_vector, cv::Vec3d(t.x(), t.y(), t.z()), Matrix(calibration_.projector),
        Distortion(calibration_.projector), pixels);
    return {pixels[0].x, pixels[0].y};
  }

 private:
  static cv::Mat Matrix(const CameraModel& m) {
    return (cv::Mat_<double>(3, 3) << m.fx, 0.0, m.cx, 0.0, m.fy, m.cy, 0.0, 0.0, 1.0);
  }
  static cv::Mat Distortion(const CameraModel& m) {
    return cv::Mat(1, 5, CV_64F, const_cast<double*>(m.distortion.data())).clone();
  }

  const CellCalibration& calibration_;
  const Transform& T_object_camera_;
};

double Bilinear(const Image<std::uint8_t>& picture, const Eigen::Vector2d& uv) {
  const int u = static_cast<int>(std::floor(uv.x()));
  const int v = static_cast<int>(std::floor(uv.y()));
  const double a = uv.x() - u;
  const double b = uv.y() - v;
  return (1 - b) * ((1 - a) * picture(u, v) + a * picture(u + 1, v)) +
         b * ((1 - a) * picture(u, v + 1) + a * picture(u + 1, v + 1));
}

CellCalibration StrongLenses() {
  CellCalibration calibration = DefaultCalibration();
  calibration.camera.distortion = {-0.9, 1.1, 3e-3, -4e-3, 0.5};
  calibration.projector.distortion = {0.6, -0.7, -2e-3, 3e-3, 0.4};
  return calibration;
}

// A picture without any fringe must be seen where OpenCV's lens model puts it.
TEST(Chain, AnyPictureIsSeenWhereOpenCvProjectsIt) {
  const CellCalibration calibration = StrongLenses();
  SimConfig config;
  config.bit_depth = 12;
  config.albedo = 0.9;
  Image<std::uint8_t> picture(calibration.projector.width, calibration.projector.height);
  std::mt19937 generator(11);
  for (std::uint8_t& value : picture) value = static_cast<std::uint8_t>(generator() & 0xffU);
  SimCell cell = MakeCell(config, calibration, MakePlane(0.6, 4));
  const Transform T = TurntablePose(1, 5, 0.5, 60.0, Eigen::Vector3d::Zero());
  ASSERT_TRUE(cell.MoveTo(T, 0));
  const Image<double> seen = ShootDn(cell, picture);
  const Image<double> white = ShootDn(cell, Flat(calibration, 255));
  const ViewTruth truth = cell.Truth();
  const OpenCvChain chain(calibration, T);
  int count = 0;
  for (int y = 3; y < calibration.camera.height; y += 23) {
    for (int x = 3; x < calibration.camera.width; x += 23) {
      const Eigen::Vector3d point = chain.PointCamera(x, y);
      const Eigen::Vector2d uv = chain.ProjectorPixel(point);
      ASSERT_LT((truth.points(x, y).cast<double>() - point).norm(), 2e-7);
      if (uv.x() < 1.0 || uv.y() < 1.0 || uv.x() > 1278.0 || uv.y() > 798.0) continue;
      ASSERT_NEAR(static_cast<double>(truth.u(x, y)), uv.x(), 1e-3);
      ASSERT_NEAR(static_cast<double>(truth.v(x, y)), uv.y(), 1e-3);
      ASSERT_NEAR(seen(x, y), white(x, y) * Bilinear(picture, uv) / 255.0, 2.0) << x << " " << y;
      ++count;
    }
  }
  EXPECT_GT(count, 500);
}

}  // namespace
}  // namespace fringe_fusion::sim
