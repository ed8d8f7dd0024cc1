#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <cstring>

#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "test/io/mesh_fixture.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

template <typename T>
T NumberAt(const std::string& bytes, std::size_t at) {
  T value{};
  EXPECT_LE(at + sizeof(T), bytes.size());
  if (at + sizeof(T) <= bytes.size()) std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

// Read back by the words of the specification. JSON is YAML.
struct GltfFile {
  YAML::Node json;
  std::string binary;

  [[nodiscard]] std::size_t Offset(int accessor) const {
    const auto view = json["accessors"][accessor]["bufferView"].as<int>();
    return json["bufferViews"][view]["byteOffset"].as<std::size_t>();
  }
  [[nodiscard]] std::size_t Count(int accessor) const {
    return json["accessors"][accessor]["count"].as<std::size_t>();
  }
};

GltfFile ReadGltf(const std::string& path) {
  const std::string bytes = ReadFile(path).value_or("");
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(NumberAt<std::uint32_t>(bytes, 4), 2U);
  EXPECT_EQ(NumberAt<std::uint32_t>(bytes, 8), bytes.size());
  const auto json_size = NumberAt<std::uint32_t>(bytes, 12);
  EXPECT_EQ(bytes.substr(16, 4), "JSON");
  EXPECT_EQ(json_size % 4, 0U);
  const std::size_t binary = 20 + json_size;
  EXPECT_EQ(NumberAt<std::uint32_t>(bytes, binary) + binary + 8, bytes.size());
  EXPECT_EQ(bytes.substr(binary + 4, 4), std::string("BIN\0", 4));
  return {YAML::Load(bytes.substr(20, json_size)), bytes.substr(binary + 8)};
}

TEST(MeshGltf, HoldsEveryAttributeAndFlagsFilledFaces) {
  const test_support::TempFolder folder;
  Mesh mesh = test_support::FullTetrahedron();
  mesh.filled_faces.assign(mesh.faces.size(), 0);
  mesh.filled_faces[1] = 1;
  ASSERT_TRUE(WriteMesh(mesh, folder / "m.glb"));
  const GltfFile file = ReadGltf(folder / "m.glb");
  const YAML::Node primitives = file.json["meshes"][0]["primitives"];
  ASSERT_EQ(primitives.size(), 2U);
  const YAML::Node attributes = primitives[0]["attributes"];
  const int positions = attributes["POSITION"].as<int>();
  ASSERT_EQ(file.Count(positions), mesh.vertices.size());
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t at = 12 * i + 4 * k;
      EXPECT_EQ(NumberAt<float>(file.binary, file.Offset(positions) + at),
                mesh.vertices[i][static_cast<int>(k)]);
      EXPECT_EQ(NumberAt<float>(file.binary, file.Offset(attributes["NORMAL"].as<int>()) + at),
                mesh.normals[i][static_cast<int>(k)]);
      EXPECT_GE(mesh.vertices[i][static_cast<int>(k)],
                file.json["accessors"][positions]["min"][k].as<float>());
    }
    const std::size_t colors = file.Offset(attributes["COLOR_0"].as<int>());
    EXPECT_EQ(NumberAt<std::uint8_t>(file.binary, colors + 4 * i + 1), mesh.colors[i].g);
    EXPECT_EQ(NumberAt<float>(file.binary, file.Offset(attributes["_SIGMA"].as<int>()) + 4 * i),
              mesh.sigma[i]);
  }
  EXPECT_EQ(file.Count(primitives[0]["indices"].as<int>()), 3 * (mesh.faces.size() - 1));
  const int filled = primitives[1]["indices"].as<int>();
  EXPECT_TRUE(primitives[1]["extras"]["filled"].as<bool>());
  ASSERT_EQ(file.Count(filled), 3U);
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(
        NumberAt<std::uint32_t>(file.binary, file.Offset(filled) + 4 * static_cast<std::size_t>(k)),
        static_cast<std::uint32_t>(mesh.faces[1][k]));
  }
}

TEST(MeshGltf, RefusesWhatHasNoFaces) {
  const test_support::TempFolder folder;
  Mesh cloud = test_support::FullTetrahedron();
  cloud.faces.clear();
  cloud.filled_faces.clear();
  const Status status = WriteMesh(cloud, folder / "m.glb");
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("without faces"), std::string::npos);
  EXPECT_FALSE(ReadMesh(folder / "m.glb"));
}

}  // namespace
}  // namespace fringe_fusion
