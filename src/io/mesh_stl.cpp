#include <Eigen/Geometry>
#include <array>
#include <cstring>
#include <unordered_map>

#include "fringe_fusion/io/file.hpp"
#include "little_endian.hpp"
#include "mesh_formats.hpp"
#include "text_lines.hpp"

namespace fringe_fusion::internal {
namespace {

constexpr std::size_t kHeaderBytes = 84;
constexpr std::size_t kTriangleBytes = 50;

using Key = std::array<std::uint32_t, 3>;

struct KeyHash {
  std::size_t operator()(const Key& key) const {
    std::uint64_t hash = 14695981039346656037ULL;
    for (const std::uint32_t word : key) hash = (hash ^ word) * 1099511628211ULL;
    return static_cast<std::size_t>(hash ^ (hash >> 29U));
  }
};

// Joins corners of equal coordinates; vertices keep the order of their first appearance.
class Welder {
 public:
  explicit Welder(std::string path) : path_(std::move(path)) {}

  [[nodiscard]] Status Add(const std::array<Eigen::Vector3f, 3>& corners) {
    Eigen::Vector3i face;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3f& corner = corners[static_cast<std::size_t>(k)];
      if (!corner.allFinite()) {
        return Fail("{}: triangle {} has a corner that is not finite: {} {} {}", path_,
                    num_triangles_, corner.x(), corner.y(), corner.z());
      }
      face[k] = Index(corner);
    }
    ++num_triangles_;
    if (face[0] != face[1] && face[1] != face[2] && face[2] != face[0]) mesh_.faces.push_back(face);
    return {};
  }
  [[nodiscard]] Mesh Take() { return std::move(mesh_); }

 private:
  int Index(const Eigen::Vector3f& corner) {
    const Eigen::Vector3f clean = corner + Eigen::Vector3f::Zero();  // -0 becomes 0
    Key key{};
    std::memcpy(key.data(), clean.data(), sizeof(key));
    const auto [found, is_new] = indices_.emplace(key, static_cast<int>(mesh_.vertices.size()));
    if (is_new) mesh_.vertices.push_back(clean);
    return found->second;
  }

  std::string path_;
  std::size_t num_triangles_ = 0;
  std::unordered_map<Key, int, KeyHash> indices_;
  Mesh mesh_;
};

Result<Mesh> ReadBinary(const std::string& bytes, const std::string& path) {
  if (bytes.size() < kHeaderBytes) {
    return Fail("{}: not an STL file: {} bytes, a binary header alone has {}", path, bytes.size(),
                kHeaderBytes);
  }
  const std::size_t count = GetUint32(bytes.data() + 80);
  if (bytes.size() != kHeaderBytes + count * kTriangleBytes) {
    return Fail("{}: the header promises {} triangles = {} bytes, but the file has {}", path, count,
                kHeaderBytes + count * kTriangleBytes, bytes.size());
  }
  Welder welder(path);
  for (std::size_t i = 0; i < count; ++i) {
    const char* triangle = bytes.data() + kHeaderBytes + i * kTriangleBytes;
    std::array<Eigen::Vector3f, 3> corners;
    for (std::size_t k = 0; k < 9; ++k) {
      corners[k / 3][static_cast<int>(k % 3)] = GetFloat(triangle + 12 + 4 * k);
    }
    if (Status status = welder.Add(corners); !status) return tl::unexpected<Error>(status.error());
  }
  return welder.Take();
}

Result<Mesh> ReadAscii(const std::string& text, const std::string& path) {
  Welder welder(path);
  TextLines lines(text);
  std::vector<std::string_view> words;
  std::array<Eigen::Vector3f, 3> corners;
  std::size_t num_corners = 0;
  bool ended = false;
  while (const std::optional<std::string_view> line = lines.Next()) {
    SplitWords(*line, words);
    if (words.empty()) continue;
    ended = ended || words[0] == "endsolid";
    if (words[0] == "endfacet") {
      if (num_corners != 3) {
        return Fail("{}: line {}: the facet has {} corners, must have 3", path, lines.number(),
                    num_corners);
      }
      num_corners = 0;
      if (Status status = welder.Add(corners); !status) {
        return tl::unexpected<Error>(status.error());
      }
    }
    if (words[0] != "vertex") continue;
    if (words.size() != 4 || num_corners == 3) {
      return Fail("{}: line {}: a vertex has 3 numbers and a facet 3 vertices", path,
                  lines.number());
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const std::optional<double> value = ParseNumber<double>(words[k + 1]);
      if (!value) return Fail("{}: line {}: no number: '{}'", path, lines.number(), words[k + 1]);
      corners[num_corners][static_cast<int>(k)] = static_cast<float>(*value);
    }
    ++num_corners;
  }
  if (!ended) return Fail("{}: truncated STL: no endsolid at the end", path);
  return welder.Take();
}

// Binary files may begin with "solid" as well: only the text form has facets spelt out.
bool LooksLikeText(const std::string& content) {
  return content.compare(0, 5, "solid") == 0 &&
         (content.find("facet") < 1024 || content.find("endsolid") < 1024);
}

}  // namespace

Result<Mesh> ReadMeshStl(const std::string& path) {
  const Result<std::string> content = ReadFile(path);
  if (!content) return Forward(content);
  return LooksLikeText(*content) ? ReadAscii(*content, path) : ReadBinary(*content, path);
}

Status WriteMeshStl(const Mesh& mesh, const std::string& path) {
  std::string bytes = "fringe_fusion, metres";
  bytes.resize(80, ' ');
  PutUint32(bytes, static_cast<std::uint32_t>(mesh.faces.size()));
  for (const Eigen::Vector3i& face : mesh.faces) {
    std::array<Eigen::Vector3f, 4> vectors;
    for (std::size_t k = 0; k < 3; ++k) {
      vectors[k + 1] = mesh.vertices[static_cast<std::size_t>(face[static_cast<int>(k)])];
    }
    vectors[0] = (vectors[2] - vectors[1]).cross(vectors[3] - vectors[1]).normalized();
    for (const Eigen::Vector3f& vector : vectors) {
      for (int k = 0; k < 3; ++k) PutFloat(bytes, vector[k]);
    }
    bytes.append(2, '\0');
  }
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return {};
  });
}

}  // namespace fringe_fusion::internal
