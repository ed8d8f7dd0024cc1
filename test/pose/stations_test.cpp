#include "fringe_fusion/pose/stations.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <limits>

#include "fringe_fusion/io/config_yaml.hpp"
#include "test/pose/station_scene.hpp"
#include "test/triangulation/analytic_view.hpp"

namespace fringe_fusion {
namespace {

using testing::MakeStationScene;
using testing::MakeTracks;
using testing::StationScene;

const IntrinsicsPrior kFreeAll{kFree, kFree, kFree};

TEST(SolveStations, KnownIntrinsicsGiveTruePosesWithTrueCovariance) {
  const StationScene scene = MakeStationScene(3, 0.0);
  double nees = 0.0;
  constexpr int kRuns = 12;
  for (int run = 0; run < kRuns; ++run) {
    const TrackSet tracks = MakeTracks(scene, 24, 18, 0.08, 10U + static_cast<unsigned>(run));
    const auto result = SolveStations(tracks, {}, {}, testing::BaselineOf(scene), {}, {});
    ASSERT_TRUE(result) << result.error().message;
    ASSERT_EQ(result->T_station_anchor.size(), 3U);
    EXPECT_NEAR(result->reduced_chi2, 1.0, 0.15);
    for (std::size_t i = 1; i < 3; ++i) {
      const Vector6d error = Log(result->T_station_anchor[i].inverse() * scene.T_station_anchor[i]);
      nees += error.dot(result->covariance[i].ldlt().solve(error)) / 6.0 / (2.0 * kRuns);
    }
    EXPECT_NEAR(result->T_station_anchor[0].translation().norm(), testing::BaselineOf(scene),
                1e-12);
  }
  // 24 samples of 6 dof that are correlated through the common points: standard error about 0.15.
  EXPECT_GT(nees, 0.6);
  EXPECT_LT(nees, 1.5);
}

TEST(SolveStations, CalibratesFromFourRolledStations) {
  const StationScene scene = MakeStationScene(4, 90.0);
  TrackSet tracks = MakeTracks(scene, 30, 30, 0.08, 5);
  // Nominal values as a data sheet states them.
  tracks.devices.anchor.fx = tracks.devices.anchor.fy = 2330.0;
  tracks.devices.anchor.cx += 4.0;
  tracks.devices.anchor.distortion[0] = 0.0;
  tracks.devices.observed.fx = tracks.devices.observed.fy = 5750.0;
  tracks.devices.observed.cy -= 6.0;
  tracks.devices.observed.distortion[0] = 0.0;
  const auto result = SolveStations(tracks, kFreeAll, kFreeAll, testing::BaselineOf(scene), {}, {});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_LT(result->sigma_intrinsics[0], 5e-4);
  EXPECT_LT(result->sigma_intrinsics[4], 5e-4);
  EXPECT_NEAR(result->devices.anchor.fx / 2400.0, 1.0, 4.0 * result->sigma_intrinsics[0]);
  EXPECT_NEAR(result->devices.observed.fx / 5600.0, 1.0, 4.0 * result->sigma_intrinsics[4]);
  EXPECT_NEAR(result->devices.anchor.cx, 639.5, 4.0 * result->sigma_intrinsics[1]);
  EXPECT_NEAR(result->devices.observed.cy, 1023.5, 4.0 * result->sigma_intrinsics[6]);
  EXPECT_NEAR(result->devices.observed.distortion[0], -0.1, 4.0 * result->sigma_intrinsics[7]);
}

TEST(SolveStations, SurvivesAThirdOfFalseSightingsOfOneStation) {
  for (const int num_stations : {2, 3, 4}) {
    for (const Eigen::Vector2d& shift : {Eigen::Vector2d(40.0, 0.0), {0.0, 25.0}, {-9.0, 7.0}}) {
      const StationScene scene = MakeStationScene(num_stations, 90.0);
      TrackSet tracks = MakeTracks(scene, 24, 18, 0.08, 21);
      for (TrackObservation& seen : tracks.observations) {
        if (seen.station == 1 && seen.track % 3 == 0) seen.pixel += shift;
      }
      const auto result = SolveStations(tracks, {}, {}, testing::BaselineOf(scene), {}, {});
      ASSERT_TRUE(result) << result.error().message;
      for (std::size_t i = 0; i < scene.T_station_anchor.size(); ++i) {
        const Vector6d error =
            Log(result->T_station_anchor[i].inverse() * scene.T_station_anchor[i]);
        // Clean tracks leave about 0.004 deg and 0.03 mm.
        EXPECT_LT(error.head<3>().norm(), 0.03 * M_PI / 180.0)
            << num_stations << " stations, shift " << shift.transpose() << ", station " << i;
        EXPECT_LT(error.tail<3>().norm(), 0.3e-3)
            << num_stations << " stations, shift " << shift.transpose() << ", station " << i;
      }
    }
  }
}

TEST(SolveStations, RefusalsNameTheCause) {
  const StationScene scene = MakeStationScene(2, 0.0);
  const TrackSet good = MakeTracks(scene, 24, 18, 0.08, 3);
  const auto message = [&](const TrackSet& tracks, const IntrinsicsPrior& prior, double baseline) {
    const auto result = SolveStations(tracks, prior, prior, baseline, {}, {});
    return result ? std::string("accepted") : result.error().message;
  };
  EXPECT_NE(message(good, {}, 0.0).find("baseline 0"), std::string::npos);
  EXPECT_NE(message(good, {-1.0, 0.0, 0.0}, 0.2).find("negative"), std::string::npos);
  TrackSet bad = good;
  bad.observations[4].pixel.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(message(bad, {}, 0.2).find("sighting 4"), std::string::npos);
  bad = good;
  bad.observations[5].station = 7;
  EXPECT_NE(message(bad, {}, 0.2).find("station 7"), std::string::npos);
  // Each station sees its own half of the tracks.
  bad = good;
  bad.observations.clear();
  for (const TrackObservation& seen : good.observations) {
    if ((seen.track < 216) == (seen.station == 0)) bad.observations.push_back(seen);
  }
  EXPECT_NE(message(bad, {}, 0.2).find("shares 0 tracks"), std::string::npos)
      << message(bad, {}, 0.2);
  // One station determines two numbers beside its pose at best.
  const std::string weak =
      message(MakeTracks(MakeStationScene(1, 0.0), 24, 18, 0.08, 3), kFreeAll, 0.2);
  EXPECT_NE(weak.find("roll the camera"), std::string::npos) << weak;
}

TEST(TracksOfProjector, FindsCodesToAFractionOfAPixel) {
  const CellCalibration cell = test::MakeScanner();
  const auto plane = test::PlaneDepth(Eigen::Vector3d(0.1, 0.05, 1.0).normalized(), 0.5);
  const PhaseMap phase = test::MakeView(cell, plane, {0.02, 0.02}, 1).phase;
  StationsConfig config;
  config.track_step_px = 6;
  const auto tracks = TracksOfProjector({phase}, cell, config);
  ASSERT_TRUE(tracks) << tracks.error().message;
  ASSERT_GT(tracks->observations.size(), 200U);
  double chi2 = 0.0;
  for (const TrackObservation& seen : tracks->observations) {
    // The truth: the camera pixel whose ray meets the plane where the projector's ray does.
    const Eigen::Vector2d ray =
        Undistort(cell.projector, tracks->anchor_px[static_cast<std::size_t>(seen.track)]);
    const Transform T = cell.T_projector_camera.inverse();
    const Eigen::Vector3d normal = Eigen::Vector3d(0.1, 0.05, 1.0).normalized();
    const Eigen::Vector3d direction = T.linear() * ray.homogeneous();
    const double s = (0.5 - normal.dot(T.translation())) / normal.dot(direction);
    const Eigen::Vector2d truth = Project(cell.camera, T.translation() + s * direction);
    const Eigen::Vector2d error = seen.pixel - truth;
    chi2 += error.dot(seen.covariance_px2.inverse() * error) / 2.0;
  }
  EXPECT_NEAR(chi2 / static_cast<double>(tracks->observations.size()), 1.0, 0.2);
}

TEST(TracksOfCamera, TakesTheCodesAsTheyAre) {
  const CellCalibration cell = test::MakeScanner();
  const auto plane = test::PlaneDepth(Eigen::Vector3d::UnitZ(), 0.5);
  PhaseMap phase = test::MakeView(cell, plane, {0.02, 0.03}, 1).phase;
  const auto tracks = TracksOfCamera({phase, phase}, cell, {});
  ASSERT_TRUE(tracks) << tracks.error().message;
  EXPECT_EQ(tracks->num_stations, 2);
  EXPECT_EQ(tracks->observations.size(), 2U * tracks->anchor_px.size());
  EXPECT_EQ(tracks->anchor_px.size(), 20U * 15U);
  EXPECT_EQ(tracks->devices.observed.width, cell.projector.width);
  phase.v = Image<float>();
  EXPECT_FALSE(TracksOfCamera({phase}, cell, {}));
  EXPECT_FALSE(TracksOfProjector({phase}, cell, {}));
  EXPECT_FALSE(TracksOfProjector({}, cell, {}));
}

TEST(MergeTracks, GivesTheTracksOfAllMapsTogether) {
  const CellCalibration cell = test::MakeScanner();
  StationsConfig config;
  config.track_step_px = 6;
  const PhaseMap near =
      test::MakeView(cell, test::PlaneDepth(Eigen::Vector3d::UnitZ(), 0.5), {0.02, 0.02}, 1).phase;
  const PhaseMap far =
      test::MakeView(cell, test::PlaneDepth(Eigen::Vector3d::UnitZ(), 0.55), {0.02, 0.02}, 2).phase;
  const auto together = TracksOfProjector({near, far}, cell, config);
  const auto one = TracksOfProjector({near}, cell, config);
  const auto two = TracksOfProjector({far}, cell, config);
  ASSERT_TRUE(together && one && two);
  const auto merged = MergeTracks({*one, *two});
  ASSERT_TRUE(merged) << merged.error().message;
  EXPECT_EQ(merged->num_stations, 2);
  EXPECT_EQ(merged->anchor_px, together->anchor_px);
  ASSERT_EQ(merged->observations.size(), together->observations.size());
  for (std::size_t i = 0; i < merged->observations.size(); ++i) {
    EXPECT_EQ(merged->observations[i].track, together->observations[i].track);
    EXPECT_EQ(merged->observations[i].station, together->observations[i].station);
    EXPECT_EQ(merged->observations[i].pixel, together->observations[i].pixel);
  }
  EXPECT_FALSE(MergeTracks({}));
  TrackSet other = *two;
  other.devices.observed.width += 1;
  EXPECT_FALSE(MergeTracks({*one, other}));
}

TEST(StationsConfig, FileEqualsTheDefaults) {
  const auto file = LoadConfigFile<StationsConfig>(SOURCE_DIR "/config/stations.yaml");
  ASSERT_TRUE(file) << file.error().message;
  std::vector<double> read;
  std::vector<double> expected;
  StationsConfig(*file).Visit([&read](const char* /*name*/, const auto& value, auto... /*bounds*/) {
    read.push_back(static_cast<double>(value));
  });
  StationsConfig().Visit([&expected](const char* /*name*/, const auto& value, auto... /*bounds*/) {
    expected.push_back(static_cast<double>(value));
  });
  EXPECT_EQ(read, expected);
}

}  // namespace
}  // namespace fringe_fusion
