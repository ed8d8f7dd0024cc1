#include "fringe_fusion/registration/view_graph.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "fringe_fusion/registration/overlap_check.hpp"
#include "test/registration/bumpy_views.hpp"
#include "test/registration/plane_views.hpp"

namespace fringe_fusion {
namespace {

using testing::BumpyScene;
using testing::MakeBumpyGraph;
using testing::PosesOf;

bool Warns(const RegistrationResult& result, const std::string& text) {
  for (const std::string& warning : result.warnings) {
    if (warning.find(text) != std::string::npos) return true;
  }
  return false;
}

BumpyScene SmallScene(int num_views) {
  BumpyScene scene;
  scene.num_views = num_views;
  scene.width = 64;
  scene.height = 52;
  return scene;
}

/// A turntable scan in an object frame that does not know the axis.
struct TableScan {
  testing::BumpyGraph truth;
  Transform T_object_table = Transform::Identity();
};

TableScan MakeTableScan(int num_views) {
  BumpyScene scene = SmallScene(num_views);
  scene.elevation_step_rad = 0.0;
  TableScan scan;
  scan.truth = MakeBumpyGraph(scene);
  scan.T_object_table.linear() = ExpRotation(Eigen::Vector3d(0.3, -0.2, 0.5));
  scan.T_object_table.translation() = Eigen::Vector3d(0.01, -0.02, 0.005);
  for (std::size_t i = 0; i < scan.truth.graph.views.size(); ++i) {
    Transform& T = scan.truth.T_object_camera_true[i];
    T = scan.T_object_table * T;
    scan.truth.graph.views[i].pose.covariance.setZero();
  }
  return scan;
}

std::vector<double> TableAngles(int num_views) {
  std::vector<double> angles;
  // The camera of the scene walks by +angle, hence the table turns by -angle.
  for (int i = 0; i < num_views; ++i) angles.push_back(-2.0 * M_PI * i / num_views);
  return angles;
}

std::vector<int> Ids(int num_views) {
  std::vector<int> ids;
  for (int i = 0; i < num_views; ++i) ids.push_back(i);
  return ids;
}

TEST(ViewGraph, SolvesTheAxisOfATurntableWithThePoses) {
  constexpr int kViews = 12;
  TableScan scan = MakeTableScan(kViews);
  // tf with an axis that is 0.6 deg and 1 mm off.
  Transform T_object_wrong = scan.T_object_table * Transform(Eigen::Translation3d(1e-3, 0.0, 0.0));
  T_object_wrong.linear() = T_object_wrong.linear() * ExpRotation({0.01, 0.0, 0.0});
  const Transform T_wrong_camera = T_object_wrong.inverse() * scan.truth.T_object_camera_true[0];
  ViewGraph& graph = scan.truth.graph;
  graph.chain = TurntableChain(Ids(kViews), TableAngles(kViews), 2e-5, 2e-6);
  for (std::size_t i = 0; i < kViews; ++i) {
    graph.views[i].pose.T_object_camera =
        T_object_wrong * graph.chain->readings[i].T_base_flange * T_wrong_camera;
  }
  const auto result = RegisterViews(graph, testing::SmallConfig());
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_TRUE(result->chain);
  const AxisLine axis = TurntableAxis(*result->chain);
  const Eigen::Vector3d direction = scan.T_object_table.linear().col(2);
  const Eigen::Vector3d on_axis = scan.T_object_table.translation();
  const double angle = std::acos(std::min(1.0, std::abs(axis.direction.dot(direction))));
  const double distance = (axis.point - on_axis).cross(direction).norm();
  EXPECT_LT(angle, 0.01 * testing::kRadPerDeg);
  EXPECT_LT(distance, 0.02e-3);
  EXPECT_LT(angle, 4.0 * axis.sigma_direction_rad);
  EXPECT_LT(result->chain->rms_sigma, 1.5);
  const auto compared = RigidAlign(graph, PosesOf(*result), scan.truth.T_object_camera_true);
  const auto start = RigidAlign(graph, PosesOf(graph), scan.truth.T_object_camera_true);
  ASSERT_TRUE(compared && start);
  EXPECT_GT(start->max_rms_m, 0.2e-3);
  EXPECT_LT(compared->max_rms_m, 8e-6);
}

TEST(ViewGraph, ReadingThatContradictsTheSurfacesIsNamed) {
  constexpr int kViews = 8;
  TableScan scan = MakeTableScan(kViews);
  ViewGraph& graph = scan.truth.graph;
  std::vector<double> angles = TableAngles(kViews);
  angles[5] += 0.004;  // the table slipped
  graph.chain = TurntableChain(Ids(kViews), angles, 2e-5, 2e-6);
  for (std::size_t i = 0; i < kViews; ++i) {
    graph.views[i].pose.T_object_camera = scan.truth.T_object_camera_true[i];
  }
  const auto result = RegisterViews(graph, testing::SmallConfig());
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(Warns(*result, "turntable at view 5"));
  const auto compared = RigidAlign(graph, PosesOf(*result), scan.truth.T_object_camera_true);
  EXPECT_LT(compared->max_rms_m, 30e-6);
}

TEST(ViewGraph, TiesPlaceAViewThatSharesNoSurface) {
  auto truth = MakeBumpyGraph(SmallScene(6));
  ViewGraph& graph = truth.graph;
  // Two ends of the chain see nothing of each other but for the tie.
  graph.views = {graph.views[0], graph.views[3]};
  truth.T_object_camera_true = {truth.T_object_camera_true[0], truth.T_object_camera_true[3]};
  graph.views[0].pose.T_object_camera = truth.T_object_camera_true[0];
  graph.views[0].pose.covariance.setZero();
  graph.views[1].pose.covariance = PoseCovariance(0.1, 0.05);
  const Transform T_first_second =
      truth.T_object_camera_true[0].inverse() * truth.T_object_camera_true[1];
  graph.ties.push_back({0, 3, T_first_second, PoseCovariance(1e-5, 1e-6), PoseSource::kEpipolar});
  const auto result = RegisterViews(graph, testing::SmallConfig());
  ASSERT_TRUE(result) << result.error().message;
  const RegisteredView& tied = result->views[1];
  EXPECT_FALSE(tied.connected);
  EXPECT_EQ(tied.information, "tie");
  const Vector6d error = Log(tied.pose.T_object_camera.inverse() * truth.T_object_camera_true[1]);
  EXPECT_LT(error.head<3>().norm(), 1e-6);
  EXPECT_LT(error.tail<3>().norm(), 1e-6);
  EXPECT_NEAR(std::sqrt(tied.pose.covariance(0, 0)), 1e-5, 1e-6);
  EXPECT_TRUE(Warns(*result, "its ties alone place it"));
}

TEST(ViewGraph, InconsistentPriorsAndTiesAreStatedAndDoNotBendTheSurfaces) {
  auto truth = MakeBumpyGraph(SmallScene(6));
  ViewGraph& graph = truth.graph;
  Vector6d slip;
  slip << 0.0, 0.02, 0.0, 1e-3, 0.0, 0.0;
  graph.views[4].pose.T_object_camera = truth.T_object_camera_true[4] * Exp(slip);
  const Transform T_01 = truth.T_object_camera_true[0].inverse() * truth.T_object_camera_true[1];
  graph.ties.push_back({0, 1, T_01 * Exp(slip), PoseCovariance(1e-4, 1e-5), PoseSource::kEpipolar});
  RegistrationConfig config = testing::SmallConfig();
  config.max_distance_m = 0.01;
  const auto result = RegisterViews(graph, config);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(Warns(*result, "view 4 (4): its given pose (tf)"));
  EXPECT_TRUE(Warns(*result, "tie of views 0 and 1 (epipolar) leaves a loop error of"));
  EXPECT_GT(result->views[4].prior_sigma, 3.0);
  EXPECT_NEAR(result->views[4].prior_turn_rad, 0.02, 1e-3);
  EXPECT_FALSE(Warns(*result, "view 2"));
  const auto compared = RigidAlign(graph, PosesOf(*result), truth.T_object_camera_true);
  EXPECT_LT(compared->max_rms_m, 0.1e-3);
}

TEST(ViewGraph, WeakDirectionsOfAPlaneAreNamed) {
  testing::PlaneScene scene;
  scene.sigma_range_m = 1e-5;
  scene.sigma_normal_rad = 0.02;
  ViewGraph graph;
  for (int i = 0; i < 2; ++i) graph.views.push_back(testing::MakePlaneView(scene, i));
  graph.views[1].pose.covariance = PoseCovariance(2e-3, 4e-4);
  const auto result = RegisterViews(graph, testing::SmallConfig());
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_NE(result->views[1].weak_directions.find("plane with normal (0.00, 0.00, 1.00)"),
            std::string::npos);
  EXPECT_EQ(result->views[1].information, "surface + prior");
  EXPECT_EQ(result->views[0].information, "held");
  EXPECT_TRUE(Warns(*result, "there it follows the priors"));
}

TEST(ViewGraph, DoubledSurfaceIsReported) {
  // Held poses, one of which is off: half of the overlap lies on a layer of its own.
  testing::PlaneScene scene;
  scene.sigma_range_m = 1e-5;
  ViewGraph graph;
  for (int i = 0; i < 3; ++i) graph.views.push_back(testing::MakePlaneView(scene, i));
  for (int y = 0; y < 60; ++y) {
    for (int x = 35; x < 60; ++x) graph.views[1].range.points(x, y).z() += 1.2e-4F;
  }
  const auto result = RegisterViews(graph, testing::SmallConfig());
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(Warns(*result, "doubled surface"));
  EXPECT_NEAR(result->views[1].doubled_m, 1.2e-4, 2e-5);
}

TEST(ViewGraph, GroupsThatShareNothingAreReported) {
  auto truth = MakeBumpyGraph(SmallScene(6));
  for (const std::size_t i : {3U, 4U, 5U}) {
    Transform& T = truth.graph.views[i].pose.T_object_camera;
    T = Transform(Eigen::Translation3d(0.3, 0.0, 0.0)) * T;
  }
  RegistrationConfig config = testing::SmallConfig();
  config.recover = false;
  const auto result = RegisterViews(truth.graph, config);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(Warns(*result, "2 groups that share no surface: 0 1 2 | 3 4 5"));
}

TEST(ViewGraph, NamesBadTiesAndReadings) {
  const auto truth = MakeBumpyGraph(SmallScene(3));
  const auto message = [](const ViewGraph& graph) {
    const Status status = Validate(graph);
    return status ? std::string("no error") : status.error().message;
  };
  EXPECT_EQ(message(truth.graph), "no error");
  ViewGraph graph = truth.graph;
  graph.ties.push_back({0, 9, Transform::Identity(), PoseCovariance(1e-3, 1e-3)});
  EXPECT_NE(message(graph).find("no view 9"), std::string::npos);
  graph.ties[0].second = 0;
  EXPECT_NE(message(graph).find("itself"), std::string::npos);
  graph.ties[0] = {0, 1, Transform::Identity(), Matrix6d::Zero()};
  EXPECT_NE(message(graph).find("covariance is zero"), std::string::npos);
  graph.ties[0].covariance = PoseCovariance(1e-3, 1e-3);
  graph.ties[0].T_first_second.linear() *= 2.0;
  EXPECT_NE(message(graph).find("orthonormal"), std::string::npos);
  graph = truth.graph;
  graph.views[2].id = 0;
  EXPECT_NE(message(graph).find("used twice"), std::string::npos);
  graph = truth.graph;
  graph.chain = TurntableChain({0, 1}, {0.0, 1.0}, 1e-3, 1e-5);
  EXPECT_NE(message(graph).find("at least 3"), std::string::npos);
  graph.chain = TurntableChain({0, 1, 7}, {0.0, 1.0, 2.0}, 1e-3, 1e-5);
  EXPECT_NE(message(graph).find("turntable at view 7"), std::string::npos);
  graph.chain = TurntableChain({0, 1, 1}, {0.0, 1.0, 2.0}, 1e-3, 1e-5);
  EXPECT_NE(message(graph).find("second reading"), std::string::npos);
  graph.chain =
      TurntableChain({0, 1, 2}, {0.0, 1.0, std::numeric_limits<double>::quiet_NaN()}, 1e-3, 1e-5);
  EXPECT_NE(message(graph).find("not finite"), std::string::npos);
}

}  // namespace
}  // namespace fringe_fusion
