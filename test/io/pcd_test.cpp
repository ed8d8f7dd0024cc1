#include <gtest/gtest.h>

#include "fringe_fusion/io/mesh_io.hpp"
#include "test/io/mesh_fixture.hpp"
#include "test/io/range_fixture.hpp"
#include "test/io/scan_fixture.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

TEST(Pcd, RangeImagesSurviveARoundTrip) {
  const TempFolder folder;
  const RangeImage range = SmallRange();
  ASSERT_TRUE(WriteRangeImage(range, folder / "r.pcd"));
  const auto read = ReadRangeImage(folder / "r.pcd");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_TRUE(SameRanges(*read, range));
  EXPECT_NEAR((read->line_of_sight.camera - range.line_of_sight.camera).norm(), 0.0, 1e-5);
}

TEST(Pcd, CloudsSurviveARoundTripAndMissesAreLeftOut) {
  const TempFolder folder;
  const Mesh mesh = FullTetrahedron();
  ASSERT_TRUE(WriteMesh(mesh, folder / "m.pcd"));
  const auto read = ReadMesh(folder / "m.pcd");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->vertices, mesh.vertices);
  EXPECT_EQ(read->normals, mesh.normals);
  EXPECT_EQ(read->sigma, mesh.sigma);
  EXPECT_TRUE(SameColors(*read, mesh));
  EXPECT_TRUE(read->faces.empty());
  ASSERT_TRUE(WriteRangeImage(SmallRange(), folder / "r.pcd"));
  const auto cloud = ReadMesh(folder / "r.pcd");
  ASSERT_TRUE(cloud) << cloud.error().message;
  EXPECT_EQ(static_cast<int>(cloud->vertices.size()), CountValid(SmallRange()));
}

const char* const kAscii =
    "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\n"
    "HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA ascii\n1 2 3\nnan nan nan\n";

TEST(Pcd, ReadsAsciiOfOthers) {
  const TempFolder folder;
  Spit(folder / "a.pcd", kAscii);
  const auto range = ReadRangeImage(folder / "a.pcd");
  ASSERT_TRUE(range) << range.error().message;
  EXPECT_EQ(range->points(0, 0), Eigen::Vector3f(1, 2, 3));
  EXPECT_FALSE(IsValid(*range, 1, 0));
}

TEST(Pcd, NamesFileAndValueOfALyingHeader) {
  const TempFolder folder;
  const std::string path = folder / "a.pcd";
  const auto complaint = [&](const std::string& from, const std::string& to) {
    Spit(path, Replaced(kAscii, from, to));
    return MessageOf(ReadMesh(path));
  };
  EXPECT_EQ(complaint("WIDTH 2", "WIDTH 3"), path + ": WIDTH x HEIGHT is 3 x 1, but POINTS is 2");
  EXPECT_EQ(complaint("WIDTH 2", "WIDTH -2"),
            path + ": WIDTH = '-2' must be a whole number from 0");
  EXPECT_EQ(complaint("nan nan nan\n", ""),
            path + ": the header promises 2 points, but 1 lines follow");
  EXPECT_EQ(complaint("DATA ascii\n", ""), path + ": not a PCD file: no DATA line");
  EXPECT_EQ(complaint("FIELDS x y z", "FIELDS a b c"), path + ": has no fields x, y, z");
  EXPECT_EQ(complaint("DATA ascii", "DATA hex"), path + ": unknown DATA 'hex'");
  ASSERT_TRUE(WriteMesh(FullTetrahedron(), path));
  const std::string binary = Slurp(path);
  Spit(path, binary.substr(0, binary.size() - 5));
  const std::string cut = MessageOf(ReadMesh(path));
  EXPECT_EQ(cut, path + ": the header promises 4 points = 128 bytes, but 123 follow");
}

}  // namespace
}  // namespace fringe_fusion
