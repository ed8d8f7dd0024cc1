#include <algorithm>
#include <array>
#include <limits>

#include "fringe_fusion/io/file.hpp"
#include "little_endian.hpp"
#include "mesh_formats.hpp"

namespace fringe_fusion::internal {
namespace {

constexpr std::uint32_t kGltfMagic = 0x46546C67;
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;
constexpr std::uint32_t kBinaryChunk = 0x004E4942;
constexpr int kFloat = 5126;
constexpr int kUnsignedInt = 5125;
constexpr int kUnsignedByte = 5121;

// The buffer of a file, and the JSON lists of its views and accessors.
class GltfBuffer {
 public:
  /// Begins an accessor; its numbers follow in bytes(). @param more JSON members, after a comma.
  /// @return its index.
  int Add(int component, const char* type, std::size_t count, const std::string& more) {
    Close();
    accessors_ +=
        fmt::format("{}{{\"bufferView\":{},\"componentType\":{},\"type\":\"{}\",\"count\":{}{}}}",
                    num_ == 0 ? "" : ",", num_, component, type, count, more);
    begin_ = bytes_.size();
    open_ = true;
    return num_++;
  }
  void Close() {
    if (!open_) return;
    views_ += fmt::format("{}{{\"buffer\":0,\"byteOffset\":{},\"byteLength\":{}}}",
                          views_.empty() ? "" : ",", begin_, bytes_.size() - begin_);
    bytes_.resize((bytes_.size() + 3) / 4 * 4, '\0');
    open_ = false;
  }
  [[nodiscard]] std::string& bytes() { return bytes_; }
  [[nodiscard]] std::string Json() const {
    return fmt::format(
        "\"buffers\":[{{\"byteLength\":{}}}],\"bufferViews\":[{}],\"accessors\":[{}]",
        bytes_.size(), views_, accessors_);
  }

 private:
  std::string bytes_;
  std::string views_;
  std::string accessors_;
  std::size_t begin_ = 0;
  int num_ = 0;
  bool open_ = false;
};

void PutVectors(const std::vector<Eigen::Vector3f>& vectors, std::string& bytes) {
  for (const Eigen::Vector3f& vector : vectors) {
    for (int k = 0; k < 3; ++k) PutFloat(bytes, vector[k]);
  }
}

// The vertex attributes as a JSON object.
std::string AddVertices(const Mesh& mesh, GltfBuffer& buffer) {
  const std::size_t count = mesh.vertices.size();
  Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::max());
  Eigen::Vector3f high = -low;
  for (const Eigen::Vector3f& vertex : mesh.vertices) {
    low = low.cwiseMin(vertex);
    high = high.cwiseMax(vertex);
  }
  const std::string bounds = fmt::format(",\"min\":[{},{},{}],\"max\":[{},{},{}]", low.x(), low.y(),
                                         low.z(), high.x(), high.y(), high.z());
  std::string attributes =
      fmt::format("\"POSITION\":{}", buffer.Add(kFloat, "VEC3", count, bounds));
  PutVectors(mesh.vertices, buffer.bytes());
  if (!mesh.normals.empty()) {
    attributes += fmt::format(",\"NORMAL\":{}", buffer.Add(kFloat, "VEC3", count, ""));
    PutVectors(mesh.normals, buffer.bytes());
  }
  if (!mesh.colors.empty()) {
    attributes += fmt::format(",\"COLOR_0\":{}",
                              buffer.Add(kUnsignedByte, "VEC4", count, ",\"normalized\":true"));
    for (const Rgb8& color : mesh.colors) {
      for (const std::uint8_t channel : {color.r, color.g, color.b, std::uint8_t{255}}) {
        PutByte(buffer.bytes(), channel);
      }
    }
  }
  if (!mesh.sigma.empty()) {
    attributes += fmt::format(",\"_SIGMA\":{}", buffer.Add(kFloat, "SCALAR", count, ""));
    for (const float sigma : mesh.sigma) PutFloat(buffer.bytes(), sigma);
  }
  return "{" + attributes + "}";
}

// The faces with a flag as a primitive; empty without any.
std::string AddFaces(const Mesh& mesh, const std::string& attributes, bool filled,
                     GltfBuffer& buffer) {
  std::string bytes;
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    const bool is_filled = !mesh.filled_faces.empty() && mesh.filled_faces[i] != 0;
    if (is_filled != filled) continue;
    for (const int corner : mesh.faces[i]) PutUint32(bytes, static_cast<std::uint32_t>(corner));
  }
  if (bytes.empty()) return "";
  const int indices = buffer.Add(kUnsignedInt, "SCALAR", bytes.size() / 4, "");
  buffer.bytes() += bytes;
  return fmt::format("{{\"attributes\":{},\"indices\":{}{}}}", attributes, indices,
                     filled ? ",\"extras\":{\"filled\":true}" : "");
}

}  // namespace

// Binary glTF 2.0. The y axis is up there and z here: the node turns the part.
Status WriteMeshGltf(const Mesh& mesh, const std::string& path) {
  if (mesh.faces.empty()) return Fail("{}: a mesh without faces is not written as glTF", path);
  GltfBuffer buffer;
  const std::string attributes = AddVertices(mesh, buffer);
  std::string primitives = AddFaces(mesh, attributes, false, buffer);
  const std::string filled = AddFaces(mesh, attributes, true, buffer);
  if (!primitives.empty() && !filled.empty()) primitives += ",";
  primitives += filled;
  buffer.Close();
  std::string json = fmt::format(
      "{{\"asset\":{{\"version\":\"2.0\",\"generator\":\"fringe_fusion\"}},\"scene\":0,"
      "\"scenes\":[{{\"nodes\":[0]}}],"
      "\"nodes\":[{{\"mesh\":0,\"rotation\":[-0.70710678,0,0,0.70710678]}}],"
      "\"meshes\":[{{\"primitives\":[{}]}}],{}}}",
      primitives, buffer.Json());
  json.resize((json.size() + 3) / 4 * 4, ' ');
  const std::size_t size = 28 + json.size() + buffer.bytes().size();
  if (size > std::numeric_limits<std::uint32_t>::max()) {
    return Fail("{}: {} bytes are more than a glTF file can hold", path, size);
  }
  std::string head;
  for (const std::size_t number :
       {std::size_t{kGltfMagic}, std::size_t{2}, size, json.size(), std::size_t{kJsonChunk}}) {
    PutUint32(head, static_cast<std::uint32_t>(number));
  }
  std::string middle;
  PutUint32(middle, static_cast<std::uint32_t>(buffer.bytes().size()));
  PutUint32(middle, kBinaryChunk);
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    for (const std::string* part : {&head, &json, &middle, &buffer.bytes()}) {
      stream.write(part->data(), static_cast<std::streamsize>(part->size()));
    }
    return {};
  });
}

}  // namespace fringe_fusion::internal
