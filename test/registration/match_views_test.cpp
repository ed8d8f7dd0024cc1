#include "fringe_fusion/registration/match_views.hpp"

#include <gtest/gtest.h>

#include "test/registration/bumpy_views.hpp"
#include "test/registration/plane_views.hpp"

namespace fringe_fusion {
namespace {

constexpr int kFinest = ViewSurface::kNumLevels - 1;

MatchLimits FinestLimits() {
  MatchLimits limits;
  limits.radius_m = 0.002;
  limits.level = kFinest;
  return limits;
}

std::vector<View> TwoPlanes(const testing::PlaneScene& scene) {
  return {testing::MakePlaneView(scene, 0), testing::MakePlaneView(scene, 1)};
}

TEST(MatchViews, ResidualIsTheSignedDistanceOfShiftedPlanes) {
  const auto set = MakeSurfaces(TwoPlanes({}), PixelSet::kRegistration, 10000);
  ASSERT_TRUE(set);
  std::vector<Transform> poses(2, Transform::Identity());
  poses[0].translation() = Eigen::Vector3d(1e-4, 0.0, 3e-4);
  const MatchSet matches = MatchViews(*set, poses, AllPairs(2), FinestLimits());
  ASSERT_EQ(matches.pairs.size(), 1U);
  const ViewPair& pair = matches.pairs.front();
  EXPECT_TRUE(pair.counts);
  EXPECT_GT(pair.from_first.size(), 1000U);
  EXPECT_GT(pair.from_second.size(), 1000U);
  for (const std::vector<Match>* side : {&pair.from_first, &pair.from_second}) {
    for (const Match& match : *side) EXPECT_NEAR(match.residual_m, 3e-4, 1e-9);
  }
  EXPECT_NEAR(matches.rms_m, 3e-4, 1e-9);
}

TEST(MatchViews, TwoFullySampledViewsShareTheirInformation) {
  testing::PlaneScene scene;
  scene.sigma_range_m = 1e-5;
  const auto set = MakeSurfaces(TwoPlanes(scene), PixelSet::kRegistration, 100000);
  ASSERT_TRUE(set);
  const std::vector<Transform> poses(2, Transform::Identity());
  const MatchSet matches = MatchViews(*set, poses, AllPairs(2), FinestLimits());
  // Each of N pairs is found from both sides; together they must weigh N / (2 sigma^2).
  double weight = 0.0;
  double plain = 0.0;
  for (const Match& match : matches.pairs.front().from_first) {
    if (std::abs(match.normalized) > 1.3F) continue;  // not reduced as an outlier
    weight += match.weight;
    plain += 0.5 / (2.0 * 1e-10);
  }
  EXPECT_NEAR(weight / plain, 1.0, 1e-3);
  EXPECT_NEAR(matches.scale, 1.0, 0.1);
}

TEST(MatchViews, NoPartnersOnTheOtherSideOfASheet) {
  const auto set = MakeSurfaces(TwoPlanes({}), PixelSet::kRegistration, 10000);
  ASSERT_TRUE(set);
  std::vector<Transform> poses(2, Transform::Identity());
  poses[1].linear() = ExpRotation(Eigen::Vector3d(M_PI, 0.0, 0.0));
  const MatchSet matches = MatchViews(*set, poses, AllPairs(2), FinestLimits());
  EXPECT_TRUE(matches.pairs.front().from_first.empty());
  EXPECT_FALSE(matches.pairs.front().counts);
}

TEST(MatchViews, BordersAreNoPartners) {
  const auto set = MakeSurfaces(TwoPlanes({}), PixelSet::kRegistration, 10000);
  ASSERT_TRUE(set);
  std::vector<Transform> poses(2, Transform::Identity());
  poses[0].translation().x() = 0.015;  // half a side
  const MatchSet matches = MatchViews(*set, poses, AllPairs(2), FinestLimits());
  const ViewPair& pair = matches.pairs.front();
  ASSERT_GT(pair.from_first.size(), 300U);
  for (const Match& match : pair.from_first) {
    EXPECT_FALSE(set->surfaces[1].points()[static_cast<std::size_t>(match.target)].border);
    const SurfacePoint& source = set->surfaces[0].points()[static_cast<std::size_t>(match.source)];
    EXPECT_LT(source.point.x() + 0.015F, 0.0146F);  // beyond the last inner column: nothing
  }
}

TEST(MatchViews, OutliersAreRejectedAndDoNotSpoilTheScale) {
  testing::PlaneScene scene;
  scene.sigma_range_m = 1e-5;
  std::vector<View> views = TwoPlanes(scene);
  for (int y = 10; y < 20; ++y) {
    for (int x = 10; x < 30; ++x) views[0].range.points(x, y).z() += 3e-4F;
  }
  const auto set = MakeSurfaces(views, PixelSet::kRegistration, 10000);
  ASSERT_TRUE(set);
  const std::vector<Transform> poses(2, Transform::Identity());
  const MatchSet matches = MatchViews(*set, poses, AllPairs(2), FinestLimits());
  for (const Match& match : matches.pairs.front().from_first) {
    EXPECT_LT(std::abs(match.residual_m), 1e-4);
  }
  EXPECT_NEAR(matches.pairs.front().scale, 1.0, 0.15);
}

TEST(MatchViews, PairsBelowTheLeastOverlapDoNotCount) {
  const auto set = MakeSurfaces(TwoPlanes({}), PixelSet::kRegistration, 10000);
  ASSERT_TRUE(set);
  std::vector<Transform> poses(2, Transform::Identity());
  poses[0].translation().x() = 0.026;  // about an eighth is left
  MatchLimits limits = FinestLimits();
  limits.min_overlap_ratio = 0.05;
  EXPECT_TRUE(MatchViews(*set, poses, AllPairs(2), limits).pairs.front().counts);
  limits.min_overlap_ratio = 0.25;
  EXPECT_FALSE(MatchViews(*set, poses, AllPairs(2), limits).pairs.front().counts);
  limits.min_overlap_ratio = 0.0;
  limits.min_correspondences = 100000;
  EXPECT_FALSE(MatchViews(*set, poses, AllPairs(2), limits).pairs.front().counts);
}

TEST(ComputeMatch, MeanNormalIsExactOnACircularArc) {
  // Two points of one sphere are at distance 0 along the mean of their normals.
  testing::BumpyScene scene;
  scene.bump_ratio = 0.0;
  scene.sigma_range_m = 0.0;
  scene.sigma_normal_rad = 0.0;
  scene.num_views = 8;
  const auto truth = testing::MakeBumpyGraph(scene);
  const auto set = MakeSurfaces(truth.graph.views, PixelSet::kRegistration, 10000);
  ASSERT_TRUE(set);
  const MatchSet matches =
      MatchViews(*set, truth.T_object_camera_true, AllPairs(8), FinestLimits());
  EXPECT_GT(matches.pairs.front().from_first.size(), 300U);
  EXPECT_LT(matches.rms_m, 2e-8);  // float points at 0.4 m
}

}  // namespace
}  // namespace fringe_fusion
