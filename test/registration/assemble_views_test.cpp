#include "fringe_fusion/registration/assemble_views.hpp"

#include <gtest/gtest.h>

#include "fringe_fusion/registration/overlap_check.hpp"
#include "test/registration/bumpy_views.hpp"
#include "test/registration/plane_views.hpp"

namespace fringe_fusion {
namespace {

using testing::PosesOf;

testing::BumpyGraph Body(int num_views, double radius_m, double bump_ratio) {
  testing::BumpyScene scene;
  scene.num_views = num_views;
  scene.radius_m = radius_m;
  scene.bump_ratio = bump_ratio;
  scene.width = 72;
  scene.height = 60;
  return testing::MakeBumpyGraph(scene);
}

AssemblyConfig FewTrials() {
  AssemblyConfig config;
  config.max_points_per_view = 400;
  config.max_trials = 5000;
  return config;
}

TEST(CheckPair, TrueAndFalsePosesDiffer) {
  const auto truth = Body(6, 0.04, 0.15);
  const auto set = MakeSurfaces(truth.graph.views, PixelSet::kAll, 20000);
  ASSERT_TRUE(set);
  const std::vector<Transform>& poses = truth.T_object_camera_true;
  const Transform T = poses[0].inverse() * poses[1];
  const PairCheck good = CheckPair(set->surfaces[0], set->surfaces[1], T, 0.3e-3);
  EXPECT_GT(good.overlap_ratio, 0.35);
  EXPECT_LT(good.conflict_ratio, 0.01);
  // Pulled towards the camera of the first view: in the way of what it saw.
  const Transform closer = Transform(Eigen::Translation3d(0.0, 0.0, -0.01)) * T;
  const PairCheck bad = CheckPair(set->surfaces[0], set->surfaces[1], closer, 0.3e-3);
  EXPECT_GT(bad.conflict_ratio, 0.3);
  EXPECT_LT(bad.evidence, 0.0);
}

TEST(RegisterUnordered, AssemblesABodyFromNothing) {
  auto truth = Body(8, 0.04, 0.15);
  for (View& view : truth.graph.views) view.pose = {};  // no pose at all
  const auto result = RegisterUnordered(truth.graph.views, testing::SmallConfig(), FewTrials());
  ASSERT_TRUE(result) << result.error().message;
  for (const RegisteredView& view : result->views) EXPECT_TRUE(view.connected) << view.id;
  const auto compared = RigidAlign(truth.graph, PosesOf(*result), truth.T_object_camera_true);
  ASSERT_TRUE(compared);
  EXPECT_LT(compared->max_rms_m, 20e-6);
}

TEST(RegisterUnordered, ViewOfAnotherBodyIsReportedNotPlaced) {
  auto truth = Body(5, 0.04, 0.15);
  testing::BumpyScene other;
  other.radius_m = 0.025;
  other.bump_ratio = 0.3;
  other.num_views = 1;
  other.width = 72;
  other.height = 60;
  View stranger = testing::MakeBumpyGraph(other).graph.views.front();
  stranger.id = 77;
  stranger.name = "stranger";
  std::vector<View> views = truth.graph.views;
  views.insert(views.begin() + 2, stranger);
  const auto result = RegisterUnordered(views, testing::SmallConfig(), FewTrials());
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_FALSE(result->views[2].connected);
  EXPECT_EQ(result->views[2].pose.source, PoseSource::kNone);
  bool told = false;
  for (const std::string& warning : result->warnings) {
    told = told || warning.find("view 77 (stranger) fits to no other view") != std::string::npos;
  }
  EXPECT_TRUE(told);
}

TEST(RegisterUnordered, FailsWhereNothingFits) {
  const std::vector<View> one = {testing::MakePlaneView({}, 0)};
  EXPECT_FALSE(RegisterUnordered(one, testing::SmallConfig(), FewTrials()));
  AssemblyConfig config;
  config.num_hypotheses = 0;
  const auto truth = Body(3, 0.04, 0.15);
  const auto bad = RegisterUnordered(truth.graph.views, testing::SmallConfig(), config);
  ASSERT_FALSE(bad);
  EXPECT_NE(bad.error().message.find("num_hypotheses"), std::string::npos);
}

TEST(RegisterViews, RecoversFromPosesThatAreFarOff) {
  auto truth = Body(6, 0.04, 0.15);
  std::mt19937 random(11);
  for (std::size_t i = 0; i < truth.graph.views.size(); ++i) {
    const Eigen::Vector3d axis = testing::RandomTwist(1.0, 0.0, random).head<3>().normalized();
    Transform moved = Transform::Identity();
    moved.linear() = ExpRotation(0.6 * axis);  // 34 deg about the middle
    truth.graph.views[i].pose.T_object_camera = moved * truth.T_object_camera_true[i];
    truth.graph.views[i].pose.covariance.setZero();
  }
  const auto result = RegisterViews(truth.graph, testing::SmallConfig());
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(result->recovered);
  const auto compared = RigidAlign(truth.graph, PosesOf(*result), truth.T_object_camera_true);
  ASSERT_TRUE(compared);
  EXPECT_LT(compared->max_rms_m, 20e-6);
  // The object frame is where the first view says it is.
  EXPECT_TRUE(result->views[0].pose.T_object_camera.matrix() ==
              truth.graph.views[0].pose.T_object_camera.matrix());
}

}  // namespace
}  // namespace fringe_fusion
