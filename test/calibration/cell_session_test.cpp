// Poses that come and go, as calibration_node collects them.
#include "fringe_fusion/calibration/cell_session.hpp"

#include <gtest/gtest.h>

#include "cell_scene.hpp"
#include "src/calibration/coverage_grid.hpp"

namespace fringe_fusion {
namespace {

using test_support::SceneCell;
using test_support::SceneTarget;
using test_support::SizesOf;

std::vector<TargetSighting> SessionSightings(int num) {
  const CalibrationTarget target = SceneTarget();
  return test_support::SightAll(SceneCell(), target, test_support::ScenePoses(target, num, 5), {});
}

CellSession SceneSession() {
  CalibrationConfig config;
  config.distortion_camera = 3;
  config.distortion_projector = 3;
  return CellSession(SceneTarget(), SizesOf(SceneCell()), config);
}

TEST(CellSession, SolvesThePosesThatItHolds) {
  CellSession session = SceneSession();
  const std::vector<TargetSighting> sightings = SessionSightings(5);
  ASSERT_TRUE(session.Add(sightings[0]));
  ASSERT_TRUE(session.Add(sightings[1]));
  const auto& too_few = session.Solve();
  ASSERT_FALSE(too_few);
  EXPECT_NE(too_few.error().message.find("3 are needed"), std::string::npos)
      << too_few.error().message;
  for (std::size_t k = 2; k < 5; ++k) ASSERT_TRUE(session.Add(sightings[k]));
  const auto& five = session.Solve();
  ASSERT_TRUE(five) << five.error().message;
  EXPECT_EQ(five->poses.size(), 5U);
  const double fx = five->calibration.camera.fx;
  EXPECT_NEAR(fx, SceneCell().camera.fx, 6.0 * std::sqrt(five->covariance(0, 0)));
  ASSERT_TRUE(session.Remove("pose 1"));
  const auto& four = session.Solve();
  ASSERT_TRUE(four) << four.error().message;
  EXPECT_EQ(four->poses.size(), 4U);
  EXPECT_NE(four->calibration.camera.fx, fx) << "the pose that went still counts";
}

TEST(CellSession, NamesWhatCannotBeAddedOrRemoved) {
  CellSession session = SceneSession();
  const auto said = [](const Status& status) {
    return status ? std::string("no error") : status.error().message;
  };
  EXPECT_EQ(said(session.Remove("")), "there is no pose to remove");
  const std::vector<TargetSighting> sightings = SessionSightings(2);
  ASSERT_TRUE(session.Add(sightings[0]));
  EXPECT_EQ(said(session.Add(sightings[0])), "there is a pose 'pose 0' already");
  ASSERT_TRUE(session.Add(sightings[1]));
  EXPECT_EQ(said(session.Remove("pose 9")), "there is no pose 'pose 9' among pose 0, pose 1");
  ASSERT_TRUE(session.Remove(""));
  ASSERT_EQ(session.sightings().size(), 1U);
  EXPECT_EQ(session.sightings().front().name, "pose 0") << "the last one goes";
  session.Clear();
  EXPECT_TRUE(session.sightings().empty());
}

TEST(CoverageOf, CountsCellsAndNamesEmptyQuarters) {
  TargetSighting sighting;
  for (int i = 0; i < 12; ++i) {
    PointSighting point;
    point.point = i;
    // Every cell of the upper left quarter of the camera; one of the projector.
    point.pixel_camera = Eigen::Vector2d(40.0 + 80.0 * (i % 4), 40.0 + 80.0 * (i / 4));
    point.pixel_projector = Eigen::Vector2d(1270.0, 790.0);
    point.has_projector = i == 0;
    sighting.points.push_back(point);
  }
  PointSighting outside;
  outside.pixel_camera = Eigen::Vector2d(-3.0, std::nan(""));
  sighting.points.push_back(outside);
  const Coverage coverage = CoverageOf({sighting}, {640, 480, 1280, 800}, 0.4);
  EXPECT_DOUBLE_EQ(coverage.camera_ratio, 12.0 / 48.0);
  EXPECT_DOUBLE_EQ(coverage.projector_ratio, 1.0 / 48.0);
  EXPECT_EQ(coverage.gaps,
            "the camera image is hardly covered in its upper right, lower left, lower right; the "
            "projector image is hardly covered");
  EXPECT_TRUE(CoverageOf({sighting}, {640, 480, 1280, 800}, 0.0).gaps.empty());
}

TEST(CoverageGrid, PutsAPixelIntoItsCell) {
  CoverageGrid grid(800, 600);
  grid.Add({-0.5, -0.5});
  grid.Add({799.4, 599.4});
  grid.Add({799.6, 100.0});
  EXPECT_TRUE(grid.Holds(0, 0));
  EXPECT_TRUE(grid.Holds(7, 5));
  EXPECT_FALSE(grid.Holds(7, 1)) << "beyond the last column";
  EXPECT_DOUBLE_EQ(grid.Ratio(), 2.0 / 48.0);
}

}  // namespace
}  // namespace fringe_fusion
