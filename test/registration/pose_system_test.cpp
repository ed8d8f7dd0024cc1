#include "fringe_fusion/registration/pose_system.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "test/registration/bumpy_views.hpp"
#include "test/registration/plane_views.hpp"

namespace fringe_fusion {
namespace {

MatchLimits CoarsestLimits() {
  MatchLimits limits;
  limits.level = ViewSurface::kNumLevels - 1;
  return limits;
}

TEST(SumPair, GradientIsThatOfTheCost) {
  testing::BumpyScene scene;
  scene.width = 64;
  scene.height = 48;
  const auto truth = testing::MakeBumpyGraph(scene);
  const auto set = MakeSurfaces(truth.graph.views, PixelSet::kRegistration, 10000);
  ASSERT_TRUE(set);
  const std::vector<Transform> poses = testing::PosesOf(truth.graph);
  const MatchSet matches = MatchViews(*set, poses, {{0, 1, false}}, CoarsestLimits());
  const ViewPair& pair = matches.pairs.front();
  const PairInformation sum = SumPair(pair, *set, poses);
  // Cost with partners, weights and normals held, as Gauss-Newton sees it.
  const auto cost = [&](int view, const Vector6d& xi) {
    std::vector<Transform> moved = poses;
    moved[static_cast<std::size_t>(view)] = moved[static_cast<std::size_t>(view)] * Exp(xi);
    double value = 0.0;
    for (const Match& match : pair.from_first) {
      const MatchGeometry fixed = ComputeMatch(pair, match, true, *set, poses);
      const auto& source = set->surfaces[0].points()[static_cast<std::size_t>(match.source)];
      const auto& target = set->surfaces[1].points()[static_cast<std::size_t>(match.target)];
      const double residual = fixed.normal.dot(moved[0] * source.point.cast<double>() -
                                               moved[1] * target.point.cast<double>());
      value += 0.5 * match.weight * residual * residual;
    }
    return value;
  };
  ViewPair one_sided = pair;
  one_sided.from_second.clear();
  const PairInformation one = SumPair(one_sided, *set, poses);
  for (int view = 0; view < 2; ++view) {
    const Matrix6d G =
        (view == 0 ? 1.0 : -1.0) * one.S * Adjoint(poses[static_cast<std::size_t>(view)]);
    const Vector6d gradient = G.transpose() * one.gradient;
    for (int i = 0; i < 6; ++i) {
      const Vector6d step = 1e-6 * Vector6d::Unit(i);
      const double numeric = (cost(view, step) - cost(view, -step)) / 2e-6;
      // The lever arm ends midway between the points, hence not exactly.
      EXPECT_NEAR(gradient[i], numeric, 0.02 * gradient.norm()) << view << " " << i;
    }
  }
  EXPECT_GT(sum.hessian.trace(), one.hessian.trace());
}

TEST(SumPair, PlaneConstrainsThreeDirectionsEvenWithNoisyNormals) {
  for (const double sigma_normal : {0.0, 0.02}) {
    testing::PlaneScene scene;
    scene.sigma_range_m = 1e-5;
    scene.sigma_normal_rad = sigma_normal;
    const auto set =
        MakeSurfaces({testing::MakePlaneView(scene, 0), testing::MakePlaneView(scene, 1)},
                     PixelSet::kRegistration, 10000);
    ASSERT_TRUE(set);
    const std::vector<Transform> poses(2, Transform::Identity());
    const MatchSet matches = MatchViews(*set, poses, AllPairs(2), CoarsestLimits());
    const PairInformation sum = SumPair(matches.pairs.front(), *set, poses);
    const Vector6d values = Eigen::SelfAdjointEigenSolver<Matrix6d>(sum.hessian).eigenvalues();
    EXPECT_LT(values[2], 1e-6 * values[5]);
    EXPECT_GT(values[3], 0.01 * values[5]);
  }
}

TEST(SolvePoses, WithoutPartnersPriorsPullBackAndHeldViewsStay) {
  const View plane = testing::MakePlaneView({}, 0);
  const auto set = MakeSurfaces({plane, plane, plane}, PixelSet::kRegistration, 1000);
  ASSERT_TRUE(set);
  std::vector<PoseConstraint> constraints(3);
  constraints[0].held = true;
  constraints[1].has_prior = true;
  constraints[1].information = InformationOf(PoseCovariance(1e-3, 1e-4));
  std::vector<Transform> poses(3, Transform::Identity());
  Vector6d away;
  away << 1e-3, -2e-3, 1e-3, 1e-4, 2e-4, -1e-4;
  for (Transform& pose : poses) pose = Exp(away);
  const auto step = SolvePoses({}, {constraints, {}, {}}, {poses}, *set, 1.0);
  ASSERT_TRUE(step);
  EXPECT_EQ(step->xi[0].norm(), 0.0);
  EXPECT_LT((step->xi[1] + away).norm(), 1e-9);
  EXPECT_EQ(step->xi[2].norm(), 0.0);  // no prior: nothing pulls, nothing blows up
  EXPECT_EQ(step->covariance[0].norm(), 0.0);
  EXPECT_NEAR(step->covariance[1](0, 0), 1e-6, 1e-8);
  EXPECT_NEAR(step->covariance[1](5, 5), 1e-8, 1e-10);
  EXPECT_NEAR(step->covariance[2](0, 0), 1.0, 1e-6);  // known to within its own size
}

TEST(SolvePoses, FailsWhenEveryPoseIsHeld) {
  const auto set = MakeSurfaces({testing::MakePlaneView({}, 0)}, PixelSet::kRegistration, 1000);
  std::vector<PoseConstraint> constraints(1);
  constraints[0].held = true;
  const auto step = SolvePoses({}, {constraints, {}, {}}, {{Transform::Identity()}}, *set, 1.0);
  ASSERT_FALSE(step);
  EXPECT_NE(step.error().message.find("held"), std::string::npos);
}

TEST(InformationOf, InvertsAndBoundsExactDirections) {
  Matrix6d covariance = PoseCovariance(1e-3, 1e-4);
  covariance(0, 5) = covariance(5, 0) = 3e-8;
  const Matrix6d identity = InformationOf(covariance) * covariance;
  EXPECT_LT((identity - Matrix6d::Identity()).norm(), 1e-8);
  covariance = PoseCovariance(1e-3, 1e-4);
  covariance(0, 0) = 0.0;
  EXPECT_NEAR(InformationOf(covariance)(0, 0) * 1e-16, 1.0, 1e-9);
}

}  // namespace
}  // namespace fringe_fusion
