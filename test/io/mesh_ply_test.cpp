#include <gtest/gtest.h>

#include "fringe_fusion/io/mesh_io.hpp"
#include "test/io/mesh_fixture.hpp"
#include "test/io/scan_fixture.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

TEST(MeshPly, EveryAttributeSurvivesARoundTripBitByBit) {
  const TempFolder folder;
  const Mesh mesh = FullTetrahedron();
  ASSERT_TRUE(WriteMesh(mesh, folder / "m.ply"));
  const auto read = ReadMesh(folder / "m.ply");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->vertices, mesh.vertices);
  EXPECT_EQ(read->faces, mesh.faces);
  EXPECT_EQ(read->normals, mesh.normals);
  EXPECT_TRUE(SameColors(*read, mesh));
  EXPECT_EQ(read->sigma, mesh.sigma);
  EXPECT_EQ(read->num_views, mesh.num_views);
  EXPECT_EQ(read->filled_faces, mesh.filled_faces);
}

TEST(MeshPly, ReadsForeignLayouts) {
  const TempFolder folder;
  Spit(folder / "m.ply",
       "ply\nformat ascii 1.0\nelement material 1\nproperty int id\nelement vertex 5\n"
       "property float red\nproperty float green\nproperty float blue\nproperty double z\n"
       "property double y\nproperty double x\nelement face 2\nproperty int group\n"
       "property list uint8 uint32 vertex_index\nend_header\n7\n"
       "1 0 0.5 3 2 1\n0 0 0 0 0 0\n0 0 0 0 0 1\n0 0 0 0 1 1\n0 0 0 0 1 0\n"
       "0 3 0 1 2\n0 4 1 2 3 4\n");
  const auto mesh = ReadMesh(folder / "m.ply");
  ASSERT_TRUE(mesh) << mesh.error().message;
  ASSERT_EQ(mesh->vertices.size(), 5U);
  EXPECT_EQ(mesh->vertices[0], Eigen::Vector3f(1, 2, 3));
  EXPECT_EQ(mesh->colors[0].r, 255);
  EXPECT_EQ(mesh->colors[0].b, 128);
  // The quadrilateral becomes two triangles.
  EXPECT_EQ(mesh->faces, (std::vector<Eigen::Vector3i>{{0, 1, 2}, {1, 2, 3}, {1, 3, 4}}));
}

TEST(MeshPly, ReadsACloudAndARangeScan) {
  const TempFolder folder;
  Spit(folder / "c.ply",
       "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
       "property float z\nelement range_grid 2\nproperty list uchar int vertex_indices\n"
       "end_header\n1 2 3\n0\n1 0\n");
  const auto cloud = ReadMesh(folder / "c.ply");
  ASSERT_TRUE(cloud) << cloud.error().message;
  EXPECT_EQ(cloud->vertices.size(), 1U);
  EXPECT_TRUE(cloud->faces.empty());
}

TEST(MeshPly, NamesFileAndValueOfEveryFault) {
  const TempFolder folder;
  const std::string path = folder / "m.ply";
  const std::string good =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
      "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  Spit(path, good);
  ASSERT_TRUE(ReadMesh(path));
  const auto complaint = [&](const std::string& from, const std::string& to) {
    Spit(path, Replaced(good, from, to));
    return MessageOf(ReadMesh(path));
  };
  EXPECT_EQ(complaint("3 0 1 2", "3 0 1 3"), path + ": face 0: vertex 3 is outside [0, 3)");
  EXPECT_EQ(complaint("3 0 1 2", "3 0 -1 2"), path + ": face 0: vertex -1 is outside [0, 3)");
  EXPECT_EQ(complaint("3 0 1 2", "3 0 1.5 2"), path + ": face 0: vertex 1.5 is outside [0, 3)");
  EXPECT_EQ(complaint("3 0 1 2", "2 0 1"), path + ": face 0: has 2 corners, needs 3");
  EXPECT_EQ(complaint("1 0 0", "1 nan 0"), path + ": vertex 1 is not finite: 1 nan 0");
  EXPECT_EQ(complaint("1 0 0", "1 0 1e300"), path + ": vertex 1 is not finite: 1 0 inf");
  EXPECT_EQ(complaint("property float y", "property float t"),
            path + ": element vertex has no x, y, z");
  EXPECT_EQ(complaint("element vertex", "element point"), path + ": has no element 'vertex'");
  EXPECT_EQ(complaint("vertex_indices", "indices"), path + ": element face has no vertex_indices");
  EXPECT_EQ(complaint("element face 1", "element face 2"),
            path + ": the header promises 2 rows of element face, but the file ends after 1");
}

}  // namespace
}  // namespace fringe_fusion
