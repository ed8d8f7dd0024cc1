#include "fringe_fusion/planning/occupancy_map.hpp"

#include <gtest/gtest.h>
#include <octomap/OcTree.h>

#include <cmath>
#include <sstream>

#include "fringe_fusion/io/config_yaml.hpp"
#include "test/fusion/synthetic_views.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

constexpr double kResolution = 0.004;

OccupancyConfig Config() {
  OccupancyConfig config;
  config.resolution_m = kResolution;
  return config;
}

// The top of a box at z = 10 mm, seen from above; the projector stands beside the camera.
View TopView(bool with_projector) {
  View view = testing::CastView(0, testing::BoxScene({0.03, 0.03, 0.01}), {0.0, 0.0, 0.2}, {});
  if (with_projector) view.range.line_of_sight.projector = Eigen::Vector3f(0.15F, 0.0F, 0.0F);
  return view;
}

OccupancyMap MapOf(const View& view, const OccupancyConfig& config = Config()) {
  Result<OccupancyMap> map = OccupancyMap::Create(config);
  EXPECT_TRUE(map);
  const Status status = map->AddView(view);
  EXPECT_TRUE(status) << (status ? "" : status.error().message);
  return std::move(*map);
}

bool Contains(const std::vector<OccupancyMap::Cell>& cells, const Eigen::Vector3d& point) {
  for (const OccupancyMap::Cell& cell : cells) {
    const double half = 0.5 * static_cast<double>(cell.size_m);
    if ((cell.center.cast<double>() - point).cwiseAbs().maxCoeff() <= half) return true;
  }
  return false;
}

TEST(OccupancyMap, SurfaceIsOccupiedAndTheWayToTheCameraIsFree) {
  const OccupancyMap map = MapOf(TopView(false));
  const auto occupied = map.OccupiedCells();
  const auto free = map.FreeCells();
  EXPECT_TRUE(Contains(occupied, {0.011, 0.005, 0.01}));
  EXPECT_TRUE(Contains(free, {0.001, 0.001, 0.1}));
  EXPECT_TRUE(Contains(free, {0.001, 0.001, 0.19}));
  // Under the surface and beside the cone of rays nothing is known.
  EXPECT_FALSE(Contains(occupied, {0.001, 0.001, 0.001}));
  EXPECT_FALSE(Contains(free, {0.001, 0.001, 0.001}));
  EXPECT_FALSE(Contains(free, {0.08, 0.001, 0.1}));
  for (const OccupancyMap::Cell& cell : occupied) {
    EXPECT_GT(cell.occupancy, 0.5F);
    EXPECT_NEAR(cell.center.z(), 0.01, 0.51 * kResolution);
  }
  EXPECT_EQ(map.resolution_m(), kResolution);
}

TEST(OccupancyMap, ProjectorRaysAreFreeToo) {
  // The camera frame's +x is the direction of the projector; half way to it from the surface.
  const View view = TopView(true);
  const Eigen::Vector3d projector = view.pose.T_object_camera * Eigen::Vector3d(0.15, 0.0, 0.0);
  const Eigen::Vector3d half_way = 0.5 * (projector + Eigen::Vector3d(0.0, 0.0, 0.01));
  EXPECT_TRUE(Contains(MapOf(view).FreeCells(), half_way));
  EXPECT_FALSE(Contains(MapOf(TopView(false)).FreeCells(), half_way));
}

TEST(OccupancyMap, ParallelRaysComeFromTheirDirection) {
  View view = TopView(false);
  view.range.line_of_sight.directional = true;
  view.range.line_of_sight.camera = Eigen::Vector3f(0.0F, 0.0F, -1.0F);
  OccupancyConfig config = Config();
  config.max_range_m = 0.1;
  const OccupancyMap map = MapOf(view, config);
  EXPECT_TRUE(Contains(map.OccupiedCells(), {0.011, 0.005, 0.01}));
  EXPECT_TRUE(Contains(map.FreeCells(), {0.025, 0.001, 0.1}));
  EXPECT_FALSE(Contains(map.FreeCells(), {0.025, 0.001, 0.13}));
}

TEST(OccupancyMap, BeyondTheRangeNothingIsOccupied) {
  OccupancyConfig config = Config();
  config.max_range_m = 0.1;
  const OccupancyMap map = MapOf(TopView(false), config);
  EXPECT_TRUE(map.OccupiedCells().empty());
  EXPECT_TRUE(Contains(map.FreeCells(), {0.001, 0.001, 0.15}));
  EXPECT_FALSE(Contains(map.FreeCells(), {0.001, 0.001, 0.05}));
}

TEST(OccupancyMap, FewPointsAreSpreadOverTheImage) {
  OccupancyConfig config = Config();
  config.max_points_per_view = 100;
  const auto occupied = MapOf(TopView(false), config).OccupiedCells();
  EXPECT_LE(occupied.size(), 100U);
  EXPECT_GE(occupied.size(), 40U);
  Eigen::AlignedBox3f box;
  for (const OccupancyMap::Cell& cell : occupied) box.extend(cell.center);
  EXPECT_LT(box.min().x(), -0.022F);
  EXPECT_GT(box.max().x(), 0.022F);
}

TEST(OccupancyMap, BinaryDataIsThatOfOctomap) {
  const OccupancyMap map = MapOf(TopView(true));
  EXPECT_EQ(map.TreeType(), "OcTree");
  const std::vector<std::int8_t> bytes = map.BinaryData();
  EXPECT_EQ(bytes, MapOf(TopView(true)).BinaryData());
  // As octomap_msgs::binaryMsgToMap reads it.
  octomap::OcTree tree(kResolution);
  std::stringstream stream(std::string(bytes.begin(), bytes.end()));
  tree.readBinaryData(stream);
  const auto* node = tree.search(0.011, 0.005, 0.01);
  ASSERT_NE(node, nullptr);
  EXPECT_TRUE(tree.isNodeOccupied(node));
  node = tree.search(0.001, 0.001, 0.1);
  ASSERT_NE(node, nullptr);
  EXPECT_FALSE(tree.isNodeOccupied(node));
}

TEST(OccupancyMap, WritesAFileThatOctomapReads) {
  const test_support::TempFolder folder;
  const OccupancyMap map = MapOf(TopView(false));
  ASSERT_TRUE(map.WriteBinary(folder / "map.bt"));
  octomap::OcTree tree(1.0);
  ASSERT_TRUE(tree.readBinary(folder / "map.bt"));
  EXPECT_DOUBLE_EQ(tree.getResolution(), kResolution);
  EXPECT_TRUE(tree.isNodeOccupied(tree.search(0.011, 0.005, 0.01)));
  const Status status = map.WriteBinary(folder / "missing/map.bt");
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("missing/map.bt"), std::string::npos);
}

TEST(OccupancyMap, RefusesBadInput) {
  OccupancyConfig config = Config();
  config.resolution_m = std::nan("");
  EXPECT_FALSE(OccupancyMap::Create(config));
  Result<OccupancyMap> map = OccupancyMap::Create(Config());
  ASSERT_TRUE(map);
  View view = TopView(false);
  view.range = MakeRangeImage(10, 10);
  EXPECT_FALSE(map->AddView(view));
  view = TopView(false);
  view.pose.source = PoseSource::kNone;
  EXPECT_FALSE(map->AddView(view));
  view = TopView(false);
  view.pose.T_object_camera.translation().x() = 1e5;
  const Status status = map->AddView(view);
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("outside the map"), std::string::npos);
  EXPECT_TRUE(map->OccupiedCells().empty());
}

TEST(OccupancyMap, ShippedSettingsAreTheDefaults) {
  const auto config = LoadConfigFile<OccupancyConfig>(SOURCE_DIR "/config/occupancy.yaml");
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_EQ(config->resolution_m, OccupancyConfig{}.resolution_m);
  EXPECT_EQ(config->max_points_per_view, OccupancyConfig{}.max_points_per_view);
  EXPECT_EQ(config->max_range_m, OccupancyConfig{}.max_range_m);
}

}  // namespace
}  // namespace fringe_fusion
