#include "fringe_fusion/geometry/transform.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <unsupported/Eigen/MatrixFunctions>

namespace fringe_fusion {
namespace {

constexpr double kPi = 3.14159265358979323846;

Vector6d RandomTwist(std::mt19937& generator, double size) {
  std::uniform_real_distribution<double> uniform(-size, size);
  Vector6d xi;
  for (int i = 0; i < 6; ++i) xi[i] = uniform(generator);
  return xi;
}

// Matrix exponential of the 4 x 4 generator: the definition of Exp.
Eigen::Matrix4d ExpByDefinition(const Vector6d& xi) {
  Eigen::Matrix4d generator = Eigen::Matrix4d::Zero();
  generator.topLeftCorner<3, 3>() = Hat(xi.head<3>());
  generator.topRightCorner<3, 1>() = xi.tail<3>();
  return generator.exp();
}

TEST(Transform, ExpIsTheMatrixExponential) {
  std::mt19937 generator(3);
  for (const double size : {1e-9, 1e-5, 0.1, 1.5}) {
    for (int i = 0; i < 20; ++i) {
      const Vector6d xi = RandomTwist(generator, size);
      EXPECT_LT((Exp(xi).matrix() - ExpByDefinition(xi)).norm(), 1e-11) << size;
    }
  }
}

TEST(Transform, LogInvertsExp) {
  std::mt19937 generator(4);
  for (const double size : {1e-10, 1e-4, 1.0, 1.7}) {
    for (int i = 0; i < 20; ++i) {
      const Vector6d xi = RandomTwist(generator, size);
      if (xi.head<3>().norm() > kPi - 1e-3) continue;
      EXPECT_LT((Log(Exp(xi)) - xi).norm(), 1e-9);
    }
  }
}

TEST(Transform, LogOfHalfATurnHasLengthPi) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1.0, -2.0, 0.5).normalized();
  const Eigen::Vector3d rotation = LogRotation(ExpRotation(kPi * axis));
  EXPECT_NEAR(rotation.norm(), kPi, 1e-7);
  EXPECT_NEAR(std::abs(rotation.normalized().dot(axis)), 1.0, 1e-9);
}

TEST(Transform, RotationBetweenIsTheLeastOne) {
  const Eigen::Vector3d from(0.3, -2.0, 0.5);
  const Eigen::Vector3d to(-1.0, 0.2, 4.0);
  const Eigen::Matrix3d R = RotationBetween(from, to);
  EXPECT_LT((R * from.normalized() - to.normalized()).norm(), 1e-12);
  const double angle = std::acos(from.normalized().dot(to.normalized()));
  EXPECT_NEAR(LogRotation(R).norm(), angle, 1e-12);
  EXPECT_LT((RotationBetween(from, 7.0 * from) - Eigen::Matrix3d::Identity()).norm(), 1e-7);
  const Eigen::Matrix3d half_turn = RotationBetween(from, -from);
  EXPECT_LT((half_turn * from + from).norm(), 1e-7);
  EXPECT_NEAR(half_turn.determinant(), 1.0, 1e-9);
}

TEST(Transform, AdjointMovesAPerturbationToTheOtherSide) {
  std::mt19937 generator(5);
  for (int i = 0; i < 20; ++i) {
    const Transform T = Exp(RandomTwist(generator, 1.0));
    const Vector6d xi = RandomTwist(generator, 0.5);
    const Transform right = T * Exp(xi);
    const Transform left = Exp(Adjoint(T) * xi) * T;
    EXPECT_LT((right.matrix() - left.matrix()).norm(), 1e-12);
  }
}

TEST(Transform, QuaternionRoundTripHasPositiveW) {
  std::mt19937 generator(6);
  for (int i = 0; i < 50; ++i) {
    const Transform T = Exp(RandomTwist(generator, 1.8));
    const Eigen::Vector4d q = QuaternionXyzw(T);
    EXPECT_GE(q[3], 0.0);
    const Result<Transform> back = MakeTransform(T.translation(), q);
    ASSERT_TRUE(back);
    EXPECT_LT((back->matrix() - T.matrix()).norm(), 1e-12);
  }
}

TEST(Transform, MakeTransformRefusesBadValues) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(MakeTransform({0.0, nan, 0.0}, {0.0, 0.0, 0.0, 1.0}));
  EXPECT_FALSE(MakeTransform({0.0, 0.0, 0.0}, {0.0, nan, 0.0, 1.0}));
  const Result<Transform> zero = MakeTransform({0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0});
  ASSERT_FALSE(zero);
  EXPECT_NE(zero.error().message.find("length 0"), std::string::npos);
  EXPECT_FALSE(MakeTransform({0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.01}));
}

TEST(Transform, MakeTransformNormalisesRoundedQuaternions) {
  const Result<Transform> T = MakeTransform({1.0, 2.0, 3.0}, {0.0, 0.0, 0.7071, 0.7071});
  ASSERT_TRUE(T);
  EXPECT_LT((T->linear().transpose() * T->linear() - Eigen::Matrix3d::Identity()).norm(), 1e-14);
  EXPECT_LT((*T * Eigen::Vector3d::UnitX() - Eigen::Vector3d(1.0, 3.0, 3.0)).norm(), 1e-12);
}

}  // namespace
}  // namespace fringe_fusion
