#include "fringe_fusion/inspection/visible_faces.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>

#include "fringe_fusion/io/mesh_io.hpp"

namespace fringe_fusion {
namespace {

namespace fs = std::filesystem;

/// A strip of `count` squares, two faces each.
Mesh MakeStrip(int count) {
  Mesh mesh;
  for (int i = 0; i <= count; ++i) {
    mesh.vertices.emplace_back(0.01F * static_cast<float>(i), 0.0F, 0.0F);
    mesh.vertices.emplace_back(0.01F * static_cast<float>(i), 0.01F, 0.003F);
  }
  for (int i = 0; i < count; ++i) {
    mesh.faces.emplace_back(2 * i, 2 * i + 2, 2 * i + 1);
    mesh.faces.emplace_back(2 * i + 1, 2 * i + 2, 2 * i + 3);
  }
  return mesh;
}

class VisibleFaces : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() /
              (std::string("visible_faces_") +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string WriteText(const std::string& text) const {
    const fs::path file = folder_ / "visible.txt";
    std::ofstream(file) << text;
    return file.string();
  }

  fs::path folder_;
};

TEST_F(VisibleFaces, MarksTheFacesOfAPart) {
  const Mesh mesh = MakeStrip(3);
  Mesh part = mesh;
  // Two of six faces, one with its indices rotated.
  part.faces = {mesh.faces[4], {mesh.faces[1][1], mesh.faces[1][2], mesh.faces[1][0]}};
  const auto flags = MarkFaces(mesh, part);
  ASSERT_TRUE(flags) << flags.error().message;
  EXPECT_EQ(*flags, (std::vector<std::uint8_t>{0, 1, 0, 0, 1, 0}));
}

TEST_F(VisibleFaces, RefusesAForeignPart) {
  const Mesh mesh = MakeStrip(3);
  Mesh part = MakeStrip(1);
  part.vertices[0].x() = 0.5F;
  const auto flags = MarkFaces(mesh, part);
  ASSERT_FALSE(flags);
  EXPECT_EQ(flags.error().message, "1 of its 2 faces are no faces of the reference");
  EXPECT_FALSE(MarkFaces(mesh, Mesh{}));
}

TEST_F(VisibleFaces, ReadsAMeshFile) {
  const Mesh mesh = MakeStrip(3);
  Mesh part = mesh;
  part.faces.resize(2);
  const std::string file = (folder_ / "visible.ply").string();
  ASSERT_TRUE(WriteMesh(part, file));
  const auto flags = ReadVisibleFaces(file, mesh, 1.0);
  ASSERT_TRUE(flags) << flags.error().message;
  EXPECT_EQ(*flags, (std::vector<std::uint8_t>{1, 1, 0, 0, 0, 0}));
}

TEST_F(VisibleFaces, ReadsFlags) {
  const auto flags = ReadVisibleFaces(WriteText("0\n1\n1\n0\n"), MakeStrip(2), 1.0);
  ASSERT_TRUE(flags) << flags.error().message;
  EXPECT_EQ(*flags, (std::vector<std::uint8_t>{0, 1, 1, 0}));
}

TEST_F(VisibleFaces, RefusesFlagsThatDoNotFit) {
  const auto few = ReadVisibleFaces(WriteText("0 1 1"), MakeStrip(2), 1.0);
  ASSERT_FALSE(few);
  EXPECT_NE(few.error().message.find("has 3 flags, the reference has 4 faces"), std::string::npos);
  const auto bad = ReadVisibleFaces(WriteText("0 1 nan 1"), MakeStrip(2), 1.0);
  ASSERT_FALSE(bad);
  EXPECT_NE(bad.error().message.find("'nan', must be 0 or 1"), std::string::npos);
  EXPECT_FALSE(ReadVisibleFaces((folder_ / "absent.txt").string(), MakeStrip(2), 1.0));
}

}  // namespace
}  // namespace fringe_fusion
