#include "fringe_fusion/pose/pose_scale.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace fringe_fusion {
namespace {

TEST(ScaleFromLength, PropagatesBothSigmas) {
  const auto scale = ScaleFromLength(2.0, 0.002, 0.1, 0.0001);
  ASSERT_TRUE(scale);
  EXPECT_DOUBLE_EQ(scale->scale, 0.05);
  EXPECT_NEAR(scale->sigma, 0.05 * std::sqrt(2.0) * 1e-3, 1e-9);
  EXPECT_FALSE(ScaleFromLength(0.0, 0.0, 0.1, 0.0));
  EXPECT_FALSE(ScaleFromLength(1.0, -1.0, 0.1, 0.0));
  EXPECT_FALSE(ScaleFromLength(std::numeric_limits<double>::quiet_NaN(), 0.0, 0.1, 0.0));
}

/// Motions of a tool whose camera sees them in units of 0.25 m.
std::vector<MotionPair> Motions(const std::vector<Vector6d>& tool, const Transform& X,
                                double noise_m) {
  std::mt19937 engine(4);
  std::normal_distribution<double> unit;
  std::vector<MotionPair> motions;
  for (const Vector6d& xi : tool) {
    MotionPair pair;
    pair.T_tool0_tool1 = Exp(xi);
    pair.T_camera0_camera1 = X.inverse() * pair.T_tool0_tool1 * X;
    for (int k = 0; k < 3; ++k) pair.T_camera0_camera1.translation()[k] += noise_m * unit(engine);
    pair.T_camera0_camera1.translation() /= 0.25;
    motions.push_back(pair);
  }
  return motions;
}

TEST(ScaleFromMotion, FindsScaleAndMounting) {
  const Transform X = Exp((Vector6d() << 0.3, -0.8, 0.4, 0.05, -0.02, 0.1).finished());
  const std::vector<Vector6d> tool{(Vector6d() << 0.5, 0.1, 0.0, 0.1, 0.0, 0.2).finished(),
                                   (Vector6d() << -0.1, 0.6, 0.2, 0.0, 0.15, -0.1).finished(),
                                   (Vector6d() << 0.2, -0.3, 0.5, -0.2, 0.1, 0.0).finished(),
                                   (Vector6d() << -0.4, 0.0, 0.3, 0.1, 0.2, 0.1).finished()};
  const auto exact = ScaleFromMotion(Motions(tool, X, 0.0));
  ASSERT_TRUE(exact) << exact.error().message;
  EXPECT_NEAR(exact->scale.scale, 0.25, 1e-9);
  EXPECT_LT(Log(exact->T_tool_camera.inverse() * X).norm(), 1e-8);
  const auto noisy = ScaleFromMotion(Motions(tool, X, 1e-4));
  ASSERT_TRUE(noisy);
  EXPECT_GT(noisy->scale.sigma, 0.0);
  EXPECT_NEAR(noisy->scale.scale, 0.25, 5.0 * noisy->scale.sigma);
}

TEST(ScaleFromMotion, OneAxisTellsNoLength) {
  const Transform X = Exp((Vector6d() << 0.3, -0.8, 0.4, 0.05, -0.02, 0.1).finished());
  const std::vector<Vector6d> turntable{(Vector6d() << 0.0, 0.0, 0.5, 0.0, 0.0, 0.0).finished(),
                                        (Vector6d() << 0.0, 0.0, 1.0, 0.0, 0.0, 0.0).finished()};
  const auto refused = ScaleFromMotion(Motions(turntable, X, 0.0));
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("one axis"), std::string::npos);
  EXPECT_FALSE(ScaleFromMotion({}));
}

}  // namespace
}  // namespace fringe_fusion
