#include <gtest/gtest.h>

#include <limits>

#include "fringe_fusion/io/mesh_io.hpp"
#include "test/io/range_fixture.hpp"
#include "test/io/scan_fixture.hpp"
#include "test/support/data_path.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

TEST(RangePly, SurvivesARoundTripBitByBit) {
  const TempFolder folder;
  RangeImage range = SmallRange();
  // A valid point whose normal and sigma are unknown.
  range.normals(1, 0).setConstant(std::numeric_limits<float>::quiet_NaN());
  range.sigma_range(1, 0) = std::numeric_limits<float>::quiet_NaN();
  ASSERT_TRUE(WriteRangeImage(range, folder / "r.ply"));
  const auto read = ReadRangeImage(folder / "r.ply");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_TRUE(SameRanges(*read, range));
  EXPECT_EQ(read->line_of_sight.camera, range.line_of_sight.camera);
  EXPECT_FALSE(read->line_of_sight.directional);
  ASSERT_TRUE(read->line_of_sight.projector);
  EXPECT_EQ(*read->line_of_sight.projector, *range.line_of_sight.projector);
  EXPECT_EQ(read->first_stamp_ns, range.first_stamp_ns);
  EXPECT_EQ(read->last_stamp_ns, range.last_stamp_ns);
}

TEST(RangePly, KeepsADirectionalLineOfSight) {
  const TempFolder folder;
  RangeImage range = SmallRange();
  range.line_of_sight = {true, {0, 0, 1}, std::nullopt};
  ASSERT_TRUE(WriteRangeImage(range, folder / "r.ply"));
  const auto read = ReadRangeImage(folder / "r.ply");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_TRUE(read->line_of_sight.directional);
  EXPECT_EQ(read->line_of_sight.camera, Eigen::Vector3f(0, 0, 1));
  EXPECT_FALSE(read->line_of_sight.projector);
}

TEST(RangePly, HasTheDocumentedLayoutAndNoNan) {
  const TempFolder folder;
  ASSERT_TRUE(WriteRangeImage(SmallRange(), folder / "r.ply"));
  const std::string text = Slurp(folder / "r.ply");
  EXPECT_NE(text.find("obj_info num_cols 7\nobj_info num_rows 5\n"), std::string::npos);
  EXPECT_NE(text.find("element range_grid 35\n"), std::string::npos);
  const auto cloud = ReadMesh(folder / "r.ply");  // refuses NaN in positions and normals
  ASSERT_TRUE(cloud) << cloud.error().message;
  EXPECT_EQ(static_cast<int>(cloud->vertices.size()), CountValid(SmallRange()));
}

TEST(RangePly, AnEmptyRangeImageIsWrittenAndRead) {
  const TempFolder folder;
  ASSERT_TRUE(WriteRangeImage(MakeRangeImage(4, 3), folder / "r.ply"));
  const auto read = ReadRangeImage(folder / "r.ply");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->width, 4);
  EXPECT_EQ(CountValid(*read), 0);
}

TEST(RangePly, AnUnorganisedCloudIsOneRow) {
  const TempFolder folder;
  Spit(folder / "c.ply",
       "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
       "property float z\nend_header\n1 2 3\n4 5 6\n");
  const auto read = ReadRangeImage(folder / "c.ply");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->width, 2);
  EXPECT_EQ(read->height, 1);
  EXPECT_EQ(read->points(1, 0), Eigen::Vector3f(4, 5, 6));
  EXPECT_FALSE(read->normals(1, 0).allFinite());
  EXPECT_FALSE(read->sigma_range(1, 0) == read->sigma_range(1, 0));
}

TEST(RangePly, NamesFileAndValueOfEveryFault) {
  const TempFolder folder;
  const std::string path = folder / "r.ply";
  const std::string good =
      "ply\nformat ascii 1.0\nobj_info num_cols 2\nobj_info num_rows 2\nelement vertex 2\n"
      "property float x\nproperty float y\nproperty float z\nelement range_grid 4\n"
      "property list uchar int vertex_indices\nend_header\n1 2 3\n4 5 6\n0\n1 0\n1 1\n0\n";
  Spit(path, good);
  const auto read = ReadRangeImage(path);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->points(1, 0), Eigen::Vector3f(1, 2, 3));
  EXPECT_EQ(read->points(0, 1), Eigen::Vector3f(4, 5, 6));
  const auto complaint = [&](const std::string& from, const std::string& to) {
    Spit(path, Replaced(good, from, to));
    return MessageOf(ReadRangeImage(path));
  };
  EXPECT_EQ(complaint("num_cols 2", "num_cols 3"),
            path + ": range_grid has 4 rows, but num_cols x num_rows is 3 x 2 = 6");
  EXPECT_EQ(complaint("num_cols 2", "num_cols -2"),
            path + ": obj_info num_cols = -2 is outside [1, 1000000]");
  EXPECT_EQ(complaint("num_cols 2", "num_cols two"),
            path + ": obj_info num_cols = two must be numbers");
  EXPECT_EQ(complaint("obj_info num_rows 2\n", ""),
            path + ": has a range_grid, but no obj_info num_rows");
  EXPECT_EQ(complaint("1 1\n", "1 2\n"),
            path + ": row 2 of range_grid names 1 vertices, the first is 2, must be one in [0, 2)");
  EXPECT_EQ(complaint("1 1\n", "2 0 1\n"),
            path + ": row 2 of range_grid names 2 vertices, the first is 0, must be one in [0, 2)");
  EXPECT_EQ(complaint("4 5 6", "4 nan 6"), path + ": vertex 1 is not finite: 4 nan 6");
  EXPECT_EQ(complaint("property float z", "property float w"), path + ": element vertex has no z");
}

TEST(RangePly, ReadsTheStanfordScans) {
  const std::string path = DataPath("stanford_bunny/bun000.ply");
  FRINGE_FUSION_REQUIRE_DATA(path);
  const auto range = ReadRangeImage(path);
  ASSERT_TRUE(range) << range.error().message;
  EXPECT_EQ(range->width, 512);
  EXPECT_EQ(range->height, 400);
  EXPECT_EQ(CountValid(*range), 40256);
  // Neighbours in the grid are neighbours in space: 0.5 mm steps, wrapped rows would be far off.
  double sum = 0.0;
  int count = 0;
  for (int y = 0; y < range->height; ++y) {
    for (int x = 1; x < range->width; ++x) {
      if (!IsValid(*range, x, y) || !IsValid(*range, x - 1, y)) continue;
      sum += (range->points(x, y) - range->points(x - 1, y)).norm();
      ++count;
    }
  }
  EXPECT_GT(count, 30000);
  EXPECT_LT(sum / count, 0.002);
}

}  // namespace
}  // namespace fringe_fusion
