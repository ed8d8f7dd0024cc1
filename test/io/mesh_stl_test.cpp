#include <gtest/gtest.h>

#include "fringe_fusion/io/mesh_io.hpp"
#include "test/io/mesh_fixture.hpp"
#include "test/io/scan_fixture.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

const char* const kTwoFacets =
    "solid part\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n"
    "   vertex 0 1 -0\n  endloop\n endfacet\n facet normal 0 0 1\n  outer loop\n"
    "   vertex 1 0 0\n   vertex 1 1 0\n   vertex 0 1 0\n  endloop\n endfacet\nendsolid part\n";

TEST(MeshStl, RoundTripWeldsTheCornersAgain) {
  const TempFolder folder;
  const Mesh mesh = FullTetrahedron();
  ASSERT_TRUE(WriteMesh(mesh, folder / "m.stl"));
  EXPECT_EQ(Slurp(folder / "m.stl").size(), 84U + 50U * 4U);
  const auto read = ReadMesh(folder / "m.stl");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->vertices, mesh.vertices);
  EXPECT_EQ(read->faces, mesh.faces);
}

TEST(MeshStl, ReadsTextAndMillimetres) {
  const TempFolder folder;
  Spit(folder / "t.STL", kTwoFacets);
  const auto mesh = ReadMesh(folder / "t.STL", 1e-3);
  ASSERT_TRUE(mesh) << mesh.error().message;
  ASSERT_EQ(mesh->vertices.size(), 4U) << "0 and -0 are one corner";
  EXPECT_EQ(mesh->faces, (std::vector<Eigen::Vector3i>{{0, 1, 2}, {1, 3, 2}}));
  EXPECT_FLOAT_EQ(mesh->vertices[3].x(), 1e-3F);
  EXPECT_NEAR(Area(*mesh), 1e-6, 1e-12);
}

TEST(MeshStl, TellsABinaryFileThatBeginsWithSolid) {
  const TempFolder folder;
  ASSERT_TRUE(WriteMesh(FullTetrahedron(), folder / "m.stl"));
  std::string bytes = Slurp(folder / "m.stl");
  bytes.replace(0, 10, "solid part");
  Spit(folder / "m.stl", bytes);
  const auto read = ReadMesh(folder / "m.stl");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->faces.size(), 4U);
}

TEST(MeshStl, NamesFileAndValueOfEveryFault) {
  const TempFolder folder;
  const std::string path = folder / "m.stl";
  ASSERT_TRUE(WriteMesh(FullTetrahedron(), path));
  const std::string good = Slurp(path);
  Spit(path, good.substr(0, 200));
  EXPECT_EQ(MessageOf(ReadMesh(path)),
            path + ": the header promises 4 triangles = 284 bytes, but the file has 200");
  std::string lie = good;
  lie.replace(80, 4, "\xff\xff\xff\xff");
  Spit(path, lie);
  EXPECT_EQ(MessageOf(ReadMesh(path)), path +
                                           ": the header promises 4294967295 triangles = "
                                           "214748364834 bytes, but the file has 284");
  Spit(path, "short");
  EXPECT_EQ(MessageOf(ReadMesh(path)),
            path + ": not an STL file: 5 bytes, a binary header alone has 84");
  std::string nan = good;
  nan.replace(84 + 12, 4, std::string("\0\0\xc0\x7f", 4));
  Spit(path, nan);
  EXPECT_EQ(
      MessageOf(ReadMesh(path)).rfind(path + ": triangle 0 has a corner that is not finite", 0),
      0U);
  const auto text = [&](const std::string& from, const std::string& to) {
    Spit(path, Replaced(kTwoFacets, from, to));
    return MessageOf(ReadMesh(path));
  };
  EXPECT_EQ(text("endsolid part\n", ""), path + ": truncated STL: no endsolid at the end");
  EXPECT_EQ(text("   vertex 1 0 0\n", ""), path + ": line 7: the facet has 2 corners, must have 3");
  EXPECT_EQ(text("vertex 1 0 0", "vertex 1 x 0"), path + ": line 5: no number: 'x'");
  EXPECT_EQ(text("vertex 1 0 0", "vertex 1 0"),
            path + ": line 5: a vertex has 3 numbers and a facet 3 vertices");
}

}  // namespace
}  // namespace fringe_fusion
