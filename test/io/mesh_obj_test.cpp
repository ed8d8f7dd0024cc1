#include <gtest/gtest.h>

#include "fringe_fusion/io/mesh_io.hpp"
#include "test/io/mesh_fixture.hpp"
#include "test/io/scan_fixture.hpp"
#include "test/support/data_path.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

TEST(MeshObj, RoundTripKeepsPositionsNormalsColorsAndFaces) {
  const TempFolder folder;
  const Mesh mesh = FullTetrahedron();
  ASSERT_TRUE(WriteMesh(mesh, folder / "m.obj"));
  const auto read = ReadMesh(folder / "m.obj");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->vertices, mesh.vertices);
  EXPECT_EQ(read->faces, mesh.faces);
  EXPECT_EQ(read->normals, mesh.normals);
  EXPECT_TRUE(SameColors(*read, mesh));
}

TEST(MeshObj, ReadsEveryFormOfFaces) {
  const TempFolder folder;
  Spit(folder / "m.obj",
       "# comment\nmtllib x.mtl\no part\nv 0 0 0\nv 1 0 0\nv 1 1 0 1.0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n"
       "usemtl steel\ns off\nf 1 2 3\nf 1/1 2/1 3/1 4/1\nf 1//1 3//1 4//1\nf -4/1/1 -3/1/1 "
       "-2/1/1\n");
  const auto mesh = ReadMesh(folder / "m.obj", 1e-3);
  ASSERT_TRUE(mesh) << mesh.error().message;
  EXPECT_EQ(mesh->faces,
            (std::vector<Eigen::Vector3i>{{0, 1, 2}, {0, 1, 2}, {0, 2, 3}, {0, 2, 3}, {0, 1, 2}}));
  EXPECT_FLOAT_EQ(mesh->vertices[2].y(), 1e-3F);
  ASSERT_EQ(mesh->normals.size(), 4U);
  EXPECT_EQ(mesh->normals[1].z(), 1.0F);
}

TEST(MeshObj, DropsNormalsThatDifferBetweenCornersOfAVertex) {
  const TempFolder folder;
  Spit(folder / "m.obj",
       "v 0 0 0\nv 1 0 0\nv 1 1 0\nvn 0 0 1\nvn 0 1 0\nf 1//1 2//1 3//1\nf 1//2 2//1 3//1\n");
  const auto mesh = ReadMesh(folder / "m.obj");
  ASSERT_TRUE(mesh) << mesh.error().message;
  EXPECT_TRUE(mesh->normals.empty());
}

TEST(MeshObj, NamesFileLineAndValueOfEveryFault) {
  const TempFolder folder;
  const std::string path = folder / "m.obj";
  const auto complaint = [&](const std::string& text) {
    Spit(path, "v 0 0 0\nv 1 0 0\nv 1 1 0\n" + text);
    return MessageOf(ReadMesh(path));
  };
  EXPECT_EQ(complaint("f 1 2 3\n"), "");
  EXPECT_EQ(complaint("f 1 2 4\n"), path + ": line 4: vertex '4' is outside [1, 3]");
  EXPECT_EQ(complaint("f 1 2 0\n"), path + ": line 4: vertex '0' is outside [1, 3]");
  EXPECT_EQ(complaint("f 1 2 -4\n"), path + ": line 4: vertex '-4' is outside [1, 3]");
  EXPECT_EQ(complaint("f 1/1 2/1 3/1\n"),
            path + ": line 4: texture coordinate '1' is outside [1, 0]");
  EXPECT_EQ(complaint("f 1//2 2//2 3//2\n"), path + ": line 4: normal '2' is outside [1, 0]");
  EXPECT_EQ(complaint("f 1 2\n"), path + ": line 4: has 2 corners, needs 3");
  EXPECT_EQ(complaint("v 1 2\n"), path + ": line 4: 'v' needs 3 numbers, has 2");
  EXPECT_EQ(complaint("v 1 nan 2\n"), path + ": line 4: 'nan' is no finite number");
}

TEST(MeshObj, ReadsTheStanfordBunny) {
  const std::string path = DataPath("stanford_bunny/stanford-bunny.obj");
  FRINGE_FUSION_REQUIRE_DATA(path);
  const auto mesh = ReadMesh(path);
  ASSERT_TRUE(mesh) << mesh.error().message;
  EXPECT_EQ(mesh->vertices.size(), 35947U);  // as its header comment says
  EXPECT_EQ(mesh->faces.size(), 69451U);
}

}  // namespace
}  // namespace fringe_fusion
