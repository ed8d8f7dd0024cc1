#include <gtest/gtest.h>

#include <fstream>

#include "fringe_fusion/io/calibration_files.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using test_support::TempFolder;

SightingsFile Sightings() {
  SightingsFile file;
  file.target.kind = TargetKind::kCircles;
  file.target.num_columns = 3;
  file.target.num_rows = 2;
  file.target.pitch_m = 0.03;
  file.target.dot_radius_m = 0.01;
  file.camera_width = 640;
  file.camera_height = 480;
  file.projector_width = 1280;
  file.projector_height = 800;
  TargetSighting sighting;
  sighting.name = "views/003: \"tilted\"";
  sighting.is_ellipse_centre = true;
  sighting.is_orientation_assumed = true;
  PointSighting point;
  point.point = 4;
  point.pixel_camera = Eigen::Vector2d(100.0 / 3.0, 200.25);
  point.covariance_camera_px2 << 1e-4, 1e-5 / 3.0, 1e-5 / 3.0, 2e-4;
  sighting.points.push_back(point);
  point.point = 5;
  point.has_projector = true;
  point.pixel_projector = Eigen::Vector2d(700.0 / 7.0, -3.5);
  point.covariance_projector_px2 << 4e-4, 0.0, 0.0, 5e-4;
  sighting.points.push_back(point);
  file.sightings = {sighting, TargetSighting{"empty", false, false, {}}};
  return file;
}

std::string Saved(const TempFolder& folder) {
  const std::string path = folder / "sightings.yaml";
  if (const Status status = SaveSightings(Sightings(), path); !status) {
    throw std::runtime_error(status.error().message);
  }
  std::ifstream stream(path);
  return {std::istreambuf_iterator<char>(stream), {}};
}

TEST(SightingsYaml, RoundTripKeepsEveryBit) {
  const TempFolder folder;
  const SightingsFile file = Sightings();
  ASSERT_TRUE(SaveSightings(file, folder / "s.yaml"));
  const auto read = LoadSightings(folder / "s.yaml");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->target.dot_radius_m, 0.01);
  EXPECT_EQ(read->camera_height, 480);
  EXPECT_EQ(read->projector_width, 1280);
  ASSERT_EQ(read->sightings.size(), 2U);
  EXPECT_TRUE(read->sightings[1].points.empty());
  const TargetSighting& sighting = read->sightings[0];
  EXPECT_EQ(sighting.name, file.sightings[0].name);
  EXPECT_TRUE(sighting.is_ellipse_centre);
  EXPECT_TRUE(sighting.is_orientation_assumed);
  ASSERT_EQ(sighting.points.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    const PointSighting& expected = file.sightings[0].points[i];
    EXPECT_EQ(sighting.points[i].point, expected.point);
    EXPECT_EQ(sighting.points[i].pixel_camera, expected.pixel_camera);
    EXPECT_EQ(sighting.points[i].covariance_camera_px2, expected.covariance_camera_px2);
    EXPECT_EQ(sighting.points[i].has_projector, expected.has_projector);
    EXPECT_EQ(sighting.points[i].pixel_projector, expected.pixel_projector);
    EXPECT_EQ(sighting.points[i].covariance_projector_px2, expected.covariance_projector_px2);
  }
}

TEST(SightingsYaml, RefusesBadPoints) {
  const TempFolder folder;
  const std::string good = Saved(folder);
  const std::string line = "- [4, ";
  ASSERT_NE(good.find(line), std::string::npos);
  const std::pair<const char*, const char*> cases[] = {
      {"- [6, ", "names point 6, the target has the points 0 to 5"},
      {"- [5, ", "names point 5 a second time"},
      {"- [4, 1, ", "has 7 numbers, must have 6 or 11"},
      {"- [1.5, ", "names point 1.5"},
      {"- 3\n      - [4, ", "points[0] must be a list of numbers"},
      {"- [4, .nan, 0, 1, 0, 1]\n      - [3, ", "must be finite"},
      {"- [4, 0, 0, 1, 2, 1]\n      - [3, ", "not positive definite"},
  };
  for (const auto& [bad, said] : cases) {
    std::string text = good;
    text.replace(text.find(line), line.size(), bad);
    std::ofstream(folder / "bad.yaml") << text;
    const auto read = LoadSightings(folder / "bad.yaml");
    ASSERT_FALSE(read) << said;
    EXPECT_NE(read.error().message.find(said), std::string::npos) << read.error().message;
    EXPECT_NE(read.error().message.find("sightings[0]"), std::string::npos);
  }
}

TEST(SightingsYaml, RefusesSizesThatMeanNothing) {
  const TempFolder folder;
  SightingsFile file = Sightings();
  file.camera_width = 0;
  EXPECT_FALSE(SaveSightings(file, folder / "s.yaml"));
  file = Sightings();
  file.projector_height = 0;
  EXPECT_FALSE(SaveSightings(file, folder / "s.yaml"));
}

}  // namespace
}  // namespace fringe_fusion
