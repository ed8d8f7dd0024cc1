#include "fringe_fusion/pose/relative_pose.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>

#include "fringe_fusion/io/config_yaml.hpp"
#include "test/pose/epipolar_scene.hpp"

namespace fringe_fusion {
namespace {

using testing::EpipolarScene;
using testing::MakeEpipolarScene;
using testing::MakeMatches;
using testing::PoseError;
using testing::SameSigma;

constexpr double kDegPerRad = 57.29577951308232;

double AngleDeg(const Transform& a, const Transform& b) {
  return kDegPerRad * LogRotation(a.linear().transpose() * b.linear()).norm();
}

double DirectionDeg(const Transform& a, const Transform& b) {
  const Eigen::Vector3d x = a.translation();
  const Eigen::Vector3d y = b.translation();
  return kDegPerRad * std::atan2(x.cross(y).norm(), x.dot(y));
}

TEST(RelativePose, IsExactWithoutNoise) {
  const EpipolarScene scene = MakeEpipolarScene();
  auto matches = MakeMatches(scene, 30, 30, SameSigma(1e-9), 1);
  for (Match& match : matches) match.covariance_px2 = 1e-4 * Eigen::Matrix2d::Identity();
  const auto pose = EstimateRelativePose(matches, scene.devices, {});
  ASSERT_TRUE(pose) << pose.error().message;
  EXPECT_LT(AngleDeg(pose->T_observed_anchor, scene.T_projector_camera), 1e-6);
  EXPECT_LT(DirectionDeg(pose->T_observed_anchor, scene.T_projector_camera), 1e-6);
  EXPECT_NEAR(pose->T_observed_anchor.translation().norm(), 1.0, 1e-12);
  EXPECT_FALSE(pose->planar);
  EXPECT_DOUBLE_EQ(pose->cheirality_ratio, 1.0);
}

// Bound and covariance: 60 runs x 5 dof, standard error of the ratio 0.04, of the NEES 0.08.
TEST(RelativePose, ReachesTheBoundAndStatesItsCovariance) {
  const auto spread = [](int i) {
    return Eigen::Vector2d(0.02 + 0.58 * ((i * 7919) % 101) / 100.0,
                           0.02 + 0.58 * ((i * 104729) % 97) / 96.0);
  };
  const auto result = testing::RunMonteCarlo(MakeEpipolarScene(), 26, spread, 60, {});
  EXPECT_EQ(result.failures, 0);
  EXPECT_LT(result.error_ratio, 1.15);
  EXPECT_GT(result.nees, 0.76);
  EXPECT_LT(result.nees, 1.26);
}

// Without weights the loss is sqrt(E[s^2] E[1/s^2]) (science 3.1).
TEST(RelativePose, SymmetricObjectiveLosesWithUnequalNoise) {
  const auto spread = [](int i) {
    return Eigen::Vector2d::Constant(i % 2 == 0 ? 0.02 : 0.6).eval();
  };
  EpipolarConfig config;
  config.objective = "symmetric";
  config.huber_sigma = 1000.0;
  const auto symmetric = testing::RunMonteCarlo(MakeEpipolarScene(), 20, spread, 12, config);
  const auto weighted = testing::RunMonteCarlo(MakeEpipolarScene(), 20, spread, 12, {});
  EXPECT_GT(symmetric.error_ratio, 5.0 * weighted.error_ratio);
  EXPECT_LT(weighted.error_ratio, 1.4);
}

TEST(RelativePose, SurvivesThirtyPercentOutliers) {
  const EpipolarScene scene = MakeEpipolarScene();
  auto matches = MakeMatches(scene, 40, 40, SameSigma(0.08), 3);
  std::mt19937 engine(5);
  for (std::size_t i = 0; i < matches.size(); i += 10) {
    for (std::size_t k = i; k < std::min(i + 3, matches.size()); ++k) {
      matches[k].observed_px = {static_cast<double>(engine() % 1280),
                                static_cast<double>(engine() % 800)};
    }
  }
  const auto pose = EstimateRelativePose(matches, scene.devices, {});
  ASSERT_TRUE(pose) << pose.error().message;
  const auto error = PoseError(pose->T_observed_anchor, scene.T_projector_camera);
  EXPECT_LT(error.dot(pose->covariance.ldlt().solve(error)), 25.0);
  EXPECT_NEAR(static_cast<double>(pose->num_inliers) / pose->num_matches, 0.7, 0.04);
}

TEST(RelativePose, FlatSceneIsUndecidedUntilSomethingDecides) {
  EpipolarScene scene = MakeEpipolarScene(0.0);
  // The other pose has the plane's normal near the baseline: on one side of the image all points
  // lie before it, too.
  const auto left_half = [](std::vector<Match> matches) {
    matches.erase(std::remove_if(matches.begin(), matches.end(),
                                 [](const Match& match) { return match.anchor_px.x() > 1300.0; }),
                  matches.end());
    return matches;
  };
  const auto matches = left_half(MakeMatches(scene, 40, 40, SameSigma(0.08), 2));
  const auto refused = EstimateRelativePose(matches, scene.devices, {});
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("too flat"), std::string::npos) << refused.error().message;

  const auto decided = EstimateRelativePose(matches, scene.devices, {}, scene.T_projector_camera);
  ASSERT_TRUE(decided) << decided.error().message;
  EXPECT_LT(AngleDeg(decided->T_observed_anchor, scene.T_projector_camera), 0.3);
  EXPECT_TRUE(decided->planar);

  // A second view of another plane by the same rig.
  EpipolarScene second = scene;
  second.depth = [](const Eigen::Vector2d& ray) { return 0.65 / (1.0 - 0.5 * ray.x()); };
  auto both = matches;
  const auto more = left_half(MakeMatches(second, 40, 40, SameSigma(0.08), 4));
  both.insert(both.end(), more.begin(), more.end());
  const auto joint = EstimateRelativePose(both, scene.devices, {});
  ASSERT_TRUE(joint) << joint.error().message;
  EXPECT_LT(AngleDeg(joint->T_observed_anchor, scene.T_projector_camera), 0.2);
}

TEST(RelativePose, RolesMayBeSwapped) {
  const EpipolarScene scene = MakeEpipolarScene();
  auto matches = MakeMatches(scene, 30, 30, SameSigma(0.08), 1);
  for (Match& match : matches) std::swap(match.anchor_px, match.observed_px);
  const auto pose =
      EstimateRelativePose(matches, {scene.devices.observed, scene.devices.anchor}, {});
  ASSERT_TRUE(pose) << pose.error().message;
  EXPECT_LT(AngleDeg(pose->T_observed_anchor, scene.T_projector_camera.inverse()), 0.05);
  EXPECT_LT(DirectionDeg(pose->T_observed_anchor, scene.T_projector_camera.inverse()), 0.05);
}

TEST(RelativePose, NoBaselineIsRefused) {
  EpipolarScene scene = MakeEpipolarScene();
  scene.T_projector_camera.translation() *= 1e-9;
  const auto pose =
      EstimateRelativePose(MakeMatches(scene, 30, 30, SameSigma(0.08), 1), scene.devices, {});
  ASSERT_FALSE(pose);
  EXPECT_NE(pose.error().message.find("baseline"), std::string::npos) << pose.error().message;
}

TEST(RelativePose, RefusalsNameTheCause) {
  const EpipolarScene scene = MakeEpipolarScene();
  const auto good = MakeMatches(scene, 30, 30, SameSigma(0.08), 1);
  const auto message = [&](const std::vector<Match>& matches) {
    const auto pose = EstimateRelativePose(matches, scene.devices, {});
    return pose ? std::string("accepted") : pose.error().message;
  };
  EXPECT_NE(message({good.begin(), good.begin() + 20}).find("20 matches, at least 50"),
            std::string::npos);
  EXPECT_NE(message({}).find("0 matches"), std::string::npos);
  auto bad = good;
  bad[7].observed_px.y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(message(bad).find("match 7"), std::string::npos);
  bad = good;
  bad[9].covariance_px2(1, 1) = 0.0;
  EXPECT_NE(message(bad).find("match 9"), std::string::npos);
  bad = good;
  for (Match& match : bad) match.observed_px = {640.0, 400.0};
  EXPECT_NE(message(bad).find("codes are equal"), std::string::npos) << message(bad);
  bad = good;
  for (Match& match : bad) match.observed_px.y() = 400.0;
  EXPECT_NE(message(bad).find("collinear"), std::string::npos) << message(bad);
  bad = good;
  std::mt19937 engine(9);
  for (Match& match : bad) {
    match.observed_px = {static_cast<double>(engine() % 1280), static_cast<double>(engine() % 800)};
  }
  EXPECT_NE(message(bad), "accepted");
}

TEST(RelativePose, NamesSwappedAndMirroredAxes) {
  const EpipolarScene scene = MakeEpipolarScene();
  const auto good = MakeMatches(scene, 30, 30, SameSigma(0.08), 1);
  const auto message = [&](const std::function<Eigen::Vector2d(Eigen::Vector2d)>& change) {
    auto matches = good;
    for (Match& match : matches) match.observed_px = change(match.observed_px);
    const auto pose = EstimateRelativePose(matches, scene.devices, {});
    return pose ? std::string("accepted") : pose.error().message;
  };
  const auto swapped = message([](Eigen::Vector2d p) { return Eigen::Vector2d(p.y(), p.x()); });
  EXPECT_NE(swapped.find("u and v are swapped"), std::string::npos) << swapped;
  const auto mirror_u =
      message([](Eigen::Vector2d p) { return Eigen::Vector2d(1279.0 - p.x(), p.y()); });
  EXPECT_NE(mirror_u.find("u axis of the projector is mirrored"), std::string::npos) << mirror_u;
  const auto mirror_v =
      message([](Eigen::Vector2d p) { return Eigen::Vector2d(p.x(), 799.0 - p.y()); });
  EXPECT_NE(mirror_v.find("v axis of the projector is mirrored"), std::string::npos) << mirror_v;
}

TEST(LiftToMetric, CovarianceIsThatOfTheRightPerturbation) {
  const EpipolarScene scene = MakeEpipolarScene();
  const auto pose =
      EstimateRelativePose(MakeMatches(scene, 30, 30, SameSigma(0.08), 1), scene.devices, {});
  ASSERT_TRUE(pose) << pose.error().message;
  const auto metric = LiftToMetric(*pose, 0.22, 1e-4);
  ASSERT_TRUE(metric);
  // Samples of (omega, d, b) against the linear covariance.
  std::mt19937 engine(3);
  std::normal_distribution<double> unit;
  const Matrix5d root = pose->covariance.llt().matrixL();
  Matrix6d sum = Matrix6d::Zero();
  constexpr int kSamples = 4000;
  for (int i = 0; i < kSamples; ++i) {
    Eigen::Matrix<double, 5, 1> z;
    for (int k = 0; k < 5; ++k) z[k] = unit(engine);
    const Eigen::Matrix<double, 5, 1> step = root * z;
    Transform T = pose->T_observed_anchor;
    T.linear() = T.linear() * ExpRotation(step.head<3>());
    T.translation() =
        (0.22 + 1e-4 * unit(engine)) *
        (T.translation() + TangentBasis(T.translation()) * step.tail<2>()).normalized();
    const Vector6d xi = Log(metric->T_observed_anchor.inverse() * T);
    sum += xi * xi.transpose();
  }
  const Matrix6d sampled = sum / kSamples;
  const Vector6d scale = metric->covariance.diagonal().cwiseSqrt().cwiseInverse();
  const Matrix6d difference =
      scale.asDiagonal() * (sampled - metric->covariance) * scale.asDiagonal();
  EXPECT_LT(difference.cwiseAbs().maxCoeff(), 0.1);
  EXPECT_FALSE(LiftToMetric(*pose, 0.0, 1e-4));
  EXPECT_FALSE(LiftToMetric(*pose, 0.2, -1.0));
  EXPECT_FALSE(LiftToMetric(*pose, std::numeric_limits<double>::quiet_NaN(), 0.0));
}

TEST(EpipolarConfig, FileEqualsTheDefaults) {
  const auto file = LoadConfigFile<EpipolarConfig>(SOURCE_DIR "/config/epipolar.yaml");
  ASSERT_TRUE(file) << file.error().message;
  EpipolarConfig defaults;
  std::vector<double> expected;
  std::vector<double> read;
  const auto collect = [](std::vector<double>& values) {
    return [&values](const char* /*name*/, const auto& value, auto... /*bounds*/) {
      if constexpr (std::is_arithmetic_v<std::decay_t<decltype(value)>>) {
        values.push_back(static_cast<double>(value));
      }
    };
  };
  defaults.Visit(collect(expected));
  EpipolarConfig(*file).Visit(collect(read));
  EXPECT_EQ(read, expected);
  EXPECT_EQ(file->objective, defaults.objective);
  defaults.objective = "algebraic";
  EXPECT_FALSE(Validate(defaults));
}

}  // namespace
}  // namespace fringe_fusion
