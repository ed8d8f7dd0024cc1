#include "fringe_fusion/registration/overlap_check.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "test/registration/bumpy_views.hpp"

namespace fringe_fusion {
namespace {

RegistrationConfig OverlapConfig() {
  RegistrationConfig config;
  config.min_correspondences = 50;
  return config;
}

TEST(HeldOutOverlapResidual, IsTheNoiseAtTheTruthAndMoreBesideIt) {
  testing::BumpyScene scene;
  scene.sigma_normal_rad = 0.0;
  const auto truth = testing::MakeBumpyGraph(scene);
  const auto at_truth =
      HeldOutOverlapResidual(truth.graph, truth.T_object_camera_true, OverlapConfig());
  ASSERT_TRUE(at_truth) << at_truth.error().message;
  // Two points with 20 um along rays that meet the surface at up to 78 degrees.
  EXPECT_GT(*at_truth, 12e-6);
  EXPECT_LT(*at_truth, std::sqrt(2.0) * 20e-6);
  const auto at_prior =
      HeldOutOverlapResidual(truth.graph, testing::PosesOf(truth.graph), OverlapConfig());
  ASSERT_TRUE(at_prior);
  EXPECT_GT(*at_prior, 5.0 * *at_truth);
}

TEST(HeldOutOverlapResidual, NamesWhatIsWrong) {
  testing::BumpyScene scene;
  scene.num_views = 2;
  auto truth = testing::MakeBumpyGraph(scene);
  std::vector<Transform> poses = truth.T_object_camera_true;
  poses.pop_back();
  EXPECT_FALSE(HeldOutOverlapResidual(truth.graph, poses, OverlapConfig()));
  poses = truth.T_object_camera_true;
  poses[1].translation().x() = std::numeric_limits<double>::quiet_NaN();
  const auto not_finite = HeldOutOverlapResidual(truth.graph, poses, OverlapConfig());
  ASSERT_FALSE(not_finite);
  EXPECT_NE(not_finite.error().message.find("view 1"), std::string::npos);
  poses[1] = truth.T_object_camera_true[1];
  poses[1].translation().x() += 1.0;
  const auto apart = HeldOutOverlapResidual(truth.graph, poses, OverlapConfig());
  ASSERT_FALSE(apart);
  EXPECT_NE(apart.error().message.find("overlap"), std::string::npos);
}

TEST(RigidAlign, IgnoresACommonMotionAndShowsASingleOne) {
  testing::BumpyScene scene;
  const auto truth = testing::MakeBumpyGraph(scene);
  Vector6d common;
  common << 0.3, -0.2, 0.1, 0.05, -0.02, 0.03;
  std::vector<Transform> poses = truth.T_object_camera_true;
  for (Transform& pose : poses) pose = Exp(common) * pose;
  const auto same = RigidAlign(truth.graph, poses, truth.T_object_camera_true);
  ASSERT_TRUE(same);
  EXPECT_LT(same->max_rms_m, 1e-12);
  EXPECT_LT(Log(same->T_reference_poses * Exp(common)).norm(), 1e-12);
  poses[2].translation().z() += 1e-3;
  const auto moved = RigidAlign(truth.graph, poses, truth.T_object_camera_true);
  ASSERT_TRUE(moved);
  EXPECT_EQ(moved->rms_m.size(), 6U);
  EXPECT_EQ(moved->max_rms_m, moved->rms_m[2]);
  // The other five share in the alignment: between half and all of the millimetre stays.
  EXPECT_GT(moved->rms_m[2], 0.5e-3);
  EXPECT_LT(moved->rms_m[2], 1e-3);
}

TEST(RigidAlign, FailsOnWrongCountsAndEmptyViews) {
  testing::BumpyScene scene;
  scene.num_views = 2;
  auto truth = testing::MakeBumpyGraph(scene);
  std::vector<Transform> poses = truth.T_object_camera_true;
  EXPECT_FALSE(RigidAlign(truth.graph, poses, {poses[0]}));
  truth.graph.views[1].range = MakeRangeImage(4, 4);
  const auto empty = RigidAlign(truth.graph, poses, poses);
  ASSERT_FALSE(empty);
  EXPECT_NE(empty.error().message.find("view 1"), std::string::npos);
}

}  // namespace
}  // namespace fringe_fusion
