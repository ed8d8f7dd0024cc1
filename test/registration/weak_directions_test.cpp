#include "fringe_fusion/registration/weak_directions.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <functional>

namespace fringe_fusion {
namespace {

const Eigen::Vector3d kMiddle(0.3, -0.2, 0.5);
const Eigen::Vector3d kAxis = Eigen::Vector3d(1.0, 2.0, 2.0).normalized();

struct Oriented {
  Eigen::Vector3d point;
  Eigen::Vector3d normal;
};

/// Information of points and normals for twists of the object frame.
Matrix6d InformationOfShape(const std::function<Oriented(double a, double b)>& shape) {
  Matrix6d sum = Matrix6d::Zero();
  for (int i = 0; i < 40; ++i) {
    for (int k = 0; k < 40; ++k) {
      const Oriented at = shape(-1.0 + i / 19.5, -1.0 + k / 19.5);
      Vector6d row;
      row << at.point.cross(at.normal), at.normal;
      sum += 1e8 * row * row.transpose();
    }
  }
  return sum;
}

Eigen::Matrix3d Frame() {
  Eigen::Matrix3d frame;
  frame.col(2) = kAxis;
  frame.col(0) = kAxis.cross(Eigen::Vector3d::UnitX()).normalized();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  return frame;
}

Oriented Placed(const Eigen::Vector3d& point, const Eigen::Vector3d& normal) {
  return {kMiddle + 0.05 * (Frame() * point), Frame() * normal.normalized()};
}

// Distance of a point from the axis through the middle.
double OffAxis(const Eigen::Vector3d& point) { return (point - kMiddle).cross(kAxis).norm(); }

WeakDirections Find(const std::function<Oriented(double a, double b)>& shape) {
  return FindWeakDirections(InformationOfShape(shape), kMiddle, 0.05);
}

TEST(FindWeakDirections, PlaneSlidesAndTurnsInItself) {
  const auto weak = Find([](double a, double b) {
    return Placed({a, b, 0.0}, Eigen::Vector3d::UnitZ());
  });
  EXPECT_EQ(weak.shape, SlidingShape::kPlane);
  EXPECT_EQ(weak.count, 3);
  EXPECT_NEAR(std::abs(weak.direction.dot(kAxis)), 1.0, 1e-6);
  EXPECT_NE(Describe(weak).find("plane"), std::string::npos);
}

TEST(FindWeakDirections, SphereTurnsAboutItsCentre) {
  const auto weak = Find([](double a, double b) {
    const Eigen::Vector3d n(0.5 * a, 0.5 * b, std::sqrt(1.0 - 0.25 * a * a - 0.25 * b * b));
    return Placed(n, n);
  });
  EXPECT_EQ(weak.shape, SlidingShape::kSphere);
  EXPECT_LT((weak.point - kMiddle).norm(), 1e-6);
  EXPECT_NE(Describe(weak).find("sphere"), std::string::npos);
}

TEST(FindWeakDirections, CylinderTurnsAndSlidesAlongItsAxis) {
  const auto weak = Find([](double a, double b) {
    const Eigen::Vector3d n(std::cos(1.2 * a), std::sin(1.2 * a), 0.0);
    return Placed(n + Eigen::Vector3d(0.0, 0.0, b), n);
  });
  EXPECT_EQ(weak.shape, SlidingShape::kCylinder);
  EXPECT_NEAR(std::abs(weak.direction.dot(kAxis)), 1.0, 1e-6);
  EXPECT_LT(OffAxis(weak.point), 1e-6);
}

TEST(FindWeakDirections, ConeTurnsAboutItsAxis) {
  const auto weak = Find([](double a, double b) {
    const double r = 1.0 + 0.5 * b;
    const Eigen::Vector3d side(std::cos(1.2 * a), std::sin(1.2 * a), 0.0);
    return Placed(r * side + Eigen::Vector3d(0.0, 0.0, b), side - Eigen::Vector3d(0.0, 0.0, 0.5));
  });
  EXPECT_EQ(weak.shape, SlidingShape::kRevolution);
  EXPECT_EQ(weak.count, 1);
  EXPECT_NEAR(std::abs(weak.direction.dot(kAxis)), 1.0, 1e-6);
  EXPECT_LT(OffAxis(weak.point), 1e-6);
}

TEST(FindWeakDirections, GutterSlidesAlongItself) {
  const auto weak = Find([](double a, double b) {
    return Placed({a, 0.5 * a * a, b}, {-a, 1.0, 0.0});  // a parabola, extruded
  });
  EXPECT_EQ(weak.shape, SlidingShape::kExtrusion);
  EXPECT_NEAR(std::abs(weak.direction.dot(kAxis)), 1.0, 1e-6);
}

TEST(FindWeakDirections, ReliefAndNothingHaveNone) {
  const auto weak = Find([](double a, double b) {
    return Placed({a, b, 0.2 * std::sin(3.0 * a) * std::cos(4.0 * b)},
                  {-0.6 * std::cos(3.0 * a) * std::cos(4.0 * b),
                   0.8 * std::sin(3.0 * a) * std::sin(4.0 * b), 1.0});
  });
  EXPECT_EQ(weak.shape, SlidingShape::kNone);
  EXPECT_EQ(Describe(weak), "");
  EXPECT_EQ(FindWeakDirections(Matrix6d::Zero(), kMiddle, 0.05).shape, SlidingShape::kNone);
}

}  // namespace
}  // namespace fringe_fusion
