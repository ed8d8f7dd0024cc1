#include "fringe_fusion/io/mesh_io.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "test/io/mesh_fixture.hpp"
#include "test/io/range_fixture.hpp"
#include "test/io/scan_fixture.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

TEST(MeshIo, ScalesPositionsAndSigmaByTheUnit) {
  const TempFolder folder;
  ASSERT_TRUE(WriteMesh(FullTetrahedron(), folder / "m.ply"));
  const auto read = ReadMesh(folder / "m.ply", 0.001);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_FLOAT_EQ(read->vertices[3].z(), -0.003F);
  EXPECT_FLOAT_EQ(read->sigma[0], 1e-8F);
  EXPECT_EQ(read->normals, FullTetrahedron().normals);
  EXPECT_NE(MessageOf(ReadMesh(folder / "m.ply", 0.0)), "");
  EXPECT_NE(MessageOf(ReadMesh(folder / "m.ply", std::numeric_limits<double>::quiet_NaN())), "");
}

TEST(MeshIo, RefusesToWriteWhatNobodyWouldRead) {
  const TempFolder folder;
  const std::string path = folder / "m.ply";
  ASSERT_TRUE(WriteMesh(FullTetrahedron(), path));
  const std::string before = Slurp(path);
  Mesh mesh = FullTetrahedron();
  mesh.vertices[1].y() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(MessageOf(WriteMesh(mesh, path)), path + ": vertex 1 is not finite");
  mesh = FullTetrahedron();
  mesh.faces[2][1] = 4;
  EXPECT_EQ(MessageOf(WriteMesh(mesh, path)), path + ": face 2 has the corner 4, outside [0, 4)");
  mesh = FullTetrahedron();
  mesh.colors.pop_back();
  EXPECT_EQ(MessageOf(WriteMesh(mesh, path)),
            path + ": the mesh has 3 colours, must have none or 4");
  EXPECT_EQ(Slurp(path), before);
  EXPECT_NE(MessageOf(WriteMesh(FullTetrahedron(), folder / "m.xyz")), "");
  EXPECT_NE(MessageOf(WriteMesh(FullTetrahedron(), folder / "none/m.ply")), "");
  RangeImage range = SmallRange();
  range.color = Image<Rgb8>(1, 1);
  EXPECT_EQ(MessageOf(WriteRangeImage(range, folder / "r.ply")),
            (folder / "r.ply") + ": the range image is 7 x 5, but a layer has 1 pixels");
}

TEST(MeshIo, NamesMissingFilesAndUnknownFormats) {
  const TempFolder folder;
  for (const char* name : {"m.ply", "m.stl", "m.obj", "m.pcd"}) {
    EXPECT_EQ(MessageOf(ReadMesh(folder / name)),
              (folder / name) + ": cannot be read: No such file or directory");
  }
  EXPECT_EQ(MessageOf(ReadMesh(folder / "m.abc")),
            (folder / "m.abc") + ": unknown mesh format '.abc', must be .ply, .stl, .obj or .pcd");
  EXPECT_NE(MessageOf(ReadRangeImage(folder / "m.stl")), "");
}

TEST(ToCloud, TakesTheValidPixelsInOrder) {
  const RangeImage range = SmallRange();
  const Mesh cloud = ToCloud(range);
  ASSERT_EQ(static_cast<int>(cloud.vertices.size()), CountValid(range));
  EXPECT_EQ(cloud.vertices[0], range.points(1, 0));
  EXPECT_EQ(cloud.normals[0], range.normals(1, 0));
  EXPECT_EQ(cloud.sigma[0], range.sigma_range(1, 0));
  EXPECT_EQ(cloud.colors[0].b, 200);
  RangeImage bare = range;
  bare.normals(1, 0).setConstant(std::numeric_limits<float>::quiet_NaN());
  EXPECT_TRUE(ToCloud(bare).normals.empty()) << "no half set of normals";
  EXPECT_TRUE(ToCloud(MakeRangeImage(3, 3)).vertices.empty());
}

}  // namespace
}  // namespace fringe_fusion
