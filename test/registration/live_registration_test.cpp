#include "fringe_fusion/registration/live_registration.hpp"

#include <gtest/gtest.h>

#include "fringe_fusion/registration/overlap_check.hpp"
#include "test/registration/bumpy_views.hpp"

namespace fringe_fusion {
namespace {

testing::BumpyGraph SmallScan() {
  testing::BumpyScene scene;
  scene.width = 64;
  scene.height = 52;
  auto truth = testing::MakeBumpyGraph(scene);
  truth.graph.views[0].pose.T_object_camera = truth.T_object_camera_true[0];
  truth.graph.views[0].pose.covariance.setZero();
  return truth;
}

std::vector<Transform> PosesOf(const LiveRegistration& live) {
  std::vector<Transform> poses;
  for (const auto& entry : live.state()) poses.push_back(entry.second.pose.T_object_camera);
  return poses;
}

TEST(LiveRegistration, PlacesEveryViewAsItComesAndSolvesInTheEnd) {
  const auto truth = SmallScan();
  auto live = LiveRegistration::Create(testing::SmallConfig(), 3);
  ASSERT_TRUE(live);
  for (const View& view : truth.graph.views) {
    const std::vector<Transform> before = PosesOf(*live);
    const auto added = live->Add(view);
    ASSERT_TRUE(added) << added.error().message;
    EXPECT_EQ(added->connected, view.id > 0) << view.id;
    for (std::size_t i = 0; i < before.size(); ++i) {
      EXPECT_TRUE(PosesOf(*live)[i].matrix() == before[i].matrix());  // the others stay
    }
  }
  const auto error_m = [&](const std::vector<Transform>& poses) {
    const auto compared = RigidAlign(truth.graph, poses, truth.T_object_camera_true);
    return compared ? compared->max_rms_m : INFINITY;
  };
  EXPECT_GT(error_m(testing::PosesOf(truth.graph)), 200e-6);
  const double one_by_one_m = error_m(PosesOf(*live));
  EXPECT_LT(one_by_one_m, 60e-6);
  const auto solved = live->Solve();
  ASSERT_TRUE(solved) << solved.error().message;
  EXPECT_LT(error_m(PosesOf(*live)), std::min(20e-6, one_by_one_m));
}

TEST(LiveRegistration, WhateverFailsLeavesTheLastGoodState) {
  const auto truth = SmallScan();
  auto live = LiveRegistration::Create(testing::SmallConfig());
  ASSERT_TRUE(live);
  EXPECT_FALSE(live->Solve());  // no view yet
  ASSERT_TRUE(live->Add(truth.graph.views[0]) && live->Add(truth.graph.views[1]));
  const std::vector<Transform> before = PosesOf(*live);
  const auto twice = live->Add(truth.graph.views[1]);
  ASSERT_FALSE(twice);
  EXPECT_NE(twice.error().message.find("view 1 (1): its id is known already"), std::string::npos);
  View empty = truth.graph.views[2];
  empty.range = MakeRangeImage(64, 52);
  EXPECT_FALSE(live->Add(empty));
  EXPECT_FALSE(live->Solve({{0, 9, Transform::Identity(), PoseCovariance(1e-3, 1e-3)}}));
  ASSERT_EQ(live->state().size(), 2U);
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_TRUE(PosesOf(*live)[i].matrix() == before[i].matrix());
  }
  EXPECT_TRUE(live->Add(truth.graph.views[2]));
}

TEST(LiveRegistration, NamesSettingsOutOfBounds) {
  RegistrationConfig config;
  config.max_distance_m = -1.0;
  const auto bad = LiveRegistration::Create(config);
  ASSERT_FALSE(bad);
  EXPECT_NE(bad.error().message.find("max_distance_m"), std::string::npos);
  const auto none = LiveRegistration::Create({}, 0);
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().message.find("max_neighbors = 0"), std::string::npos);
}

}  // namespace
}  // namespace fringe_fusion
