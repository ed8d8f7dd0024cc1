#include <array>
#include <cmath>

#include "fringe_fusion/io/file.hpp"
#include "mesh_formats.hpp"
#include "text_lines.hpp"

namespace fringe_fusion::internal {
namespace {

using Words = std::vector<std::string_view>;

class ObjReader {
 public:
  explicit ObjReader(std::string path) : path_(std::move(path)) {}

  [[nodiscard]] Status Add(const Words& words, int line) {
    line_ = line;
    if (words[0] == "v") return AddVertex(words);
    if (words[0] == "vn") return AddNormal(words);
    if (words[0] == "vt") ++num_textures_;
    if (words[0] == "f") return AddFace(words);
    return {};
  }

  [[nodiscard]] Result<Mesh> Finish() {
    if (!mesh_.colors.empty() && mesh_.colors.size() != mesh_.vertices.size()) {
      return Fail("{}: {} of {} vertices have a colour", path_, mesh_.colors.size(),
                  mesh_.vertices.size());
    }
    // Normals belong to corners here; they are kept where every vertex has exactly one.
    const bool complete = !normals_.empty() && normal_of_vertex_.size() == mesh_.vertices.size() &&
                          consistent_normals_;
    for (std::size_t i = 0; complete && i < normal_of_vertex_.size(); ++i) {
      if (normal_of_vertex_[i] < 0) {
        mesh_.normals.clear();
        break;
      }
      mesh_.normals.push_back(normals_[static_cast<std::size_t>(normal_of_vertex_[i])]);
    }
    return std::move(mesh_);
  }

 private:
  // Numbers behind the keyword.
  [[nodiscard]] Result<std::array<double, 6>> Numbers(const Words& words, std::size_t least) {
    std::array<double, 6> numbers{};
    if (words.size() < least + 1) {
      return Fail("{}: line {}: '{}' needs {} numbers, has {}", path_, line_, words[0], least,
                  words.size() - 1);
    }
    for (std::size_t k = 0; k + 1 < words.size() && k < numbers.size(); ++k) {
      const std::optional<double> number = ParseNumber<double>(words[k + 1]);
      if (!number || !std::isfinite(*number)) {
        return Fail("{}: line {}: '{}' is no finite number", path_, line_, words[k + 1]);
      }
      numbers[k] = *number;
    }
    return numbers;
  }

  [[nodiscard]] Status AddVertex(const Words& words) {
    const auto numbers = Numbers(words, 3);
    if (!numbers) return tl::unexpected<Error>(numbers.error());
    mesh_.vertices.emplace_back(Eigen::Vector3d(numbers->data()).cast<float>());
    if (words.size() == 7) {
      const auto byte = [&](std::size_t k) {
        return static_cast<std::uint8_t>(
            std::lround(255.0 * std::min(1.0, std::max(0.0, (*numbers)[k]))));
      };
      mesh_.colors.push_back({byte(3), byte(4), byte(5)});
    }
    return {};
  }

  [[nodiscard]] Status AddNormal(const Words& words) {
    const auto numbers = Numbers(words, 3);
    if (!numbers) return tl::unexpected<Error>(numbers.error());
    normals_.emplace_back(Eigen::Vector3d(numbers->data()).cast<float>());
    return {};
  }

  // An index counts from 1, or from the end when it is negative.
  [[nodiscard]] Result<int> Index(std::string_view word, std::size_t count, const char* what) {
    const std::optional<long long> number = ParseNumber<long long>(word);
    const auto last = static_cast<long long>(count);
    const long long index = number ? (*number < 0 ? last + *number : *number - 1) : -1;
    if (index < 0 || index >= last) {
      return Fail("{}: line {}: {} '{}' is outside [1, {}]", path_, line_, what, word, count);
    }
    return static_cast<int>(index);
  }

  // v, v/vt, v//vn or v/vt/vn.
  [[nodiscard]] Result<int> Corner(std::string_view word) {
    const std::size_t first = word.find('/');
    const Result<int> vertex = Index(word.substr(0, first), mesh_.vertices.size(), "vertex");
    if (!vertex || first == std::string_view::npos) return vertex;
    const std::size_t second = word.find('/', first + 1);
    const std::string_view texture = word.substr(first + 1, second - first - 1);
    if (!texture.empty()) {
      const Result<int> checked = Index(texture, num_textures_, "texture coordinate");
      if (!checked) return checked;
    }
    if (second == std::string_view::npos) return vertex;
    const Result<int> normal = Index(word.substr(second + 1), normals_.size(), "normal");
    if (!normal) return normal;
    normal_of_vertex_.resize(mesh_.vertices.size(), -1);
    int& known = normal_of_vertex_[static_cast<std::size_t>(*vertex)];
    consistent_normals_ = consistent_normals_ && (known < 0 || known == *normal);
    known = *normal;
    return vertex;
  }

  [[nodiscard]] Status AddFace(const Words& words) {
    std::vector<int> corners;
    for (std::size_t k = 1; k < words.size(); ++k) {
      const Result<int> corner = Corner(words[k]);
      if (!corner) return tl::unexpected<Error>(corner.error());
      corners.push_back(*corner);
    }
    return AppendPolygon(corners, mesh_.vertices.size(), fmt::format("{}: line {}", path_, line_),
                         mesh_.faces);
  }

  std::string path_;
  int line_ = 0;
  Mesh mesh_;
  std::vector<Eigen::Vector3f> normals_;
  std::vector<int> normal_of_vertex_;
  bool consistent_normals_ = true;
  std::size_t num_textures_ = 0;
};

}  // namespace

Result<Mesh> ReadMeshObj(const std::string& path) {
  const Result<std::string> content = ReadFile(path);
  if (!content) return Forward(content);
  ObjReader reader(path);
  TextLines lines(*content);
  Words words;
  while (const std::optional<std::string_view> line = lines.Next()) {
    SplitWords(*line, words);
    if (words.empty() || words[0][0] == '#') continue;
    if (Status status = reader.Add(words, lines.number()); !status) {
      return tl::unexpected<Error>(status.error());
    }
  }
  return reader.Finish();
}

Status WriteMeshObj(const Mesh& mesh, const std::string& path) {
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream << "# fringe_fusion, metres\n";
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
      const Eigen::Vector3f& v = mesh.vertices[i];
      stream << fmt::format("v {} {} {}", v.x(), v.y(), v.z());
      if (!mesh.colors.empty()) {
        const Rgb8& color = mesh.colors[i];
        stream << fmt::format(" {:.4f} {:.4f} {:.4f}", color.r / 255.0, color.g / 255.0,
                              color.b / 255.0);
      }
      stream << '\n';
    }
    for (const Eigen::Vector3f& n : mesh.normals) {
      stream << fmt::format("vn {} {} {}\n", n.x(), n.y(), n.z());
    }
    for (const Eigen::Vector3i& face : mesh.faces) {
      const Eigen::Vector3i f = face + Eigen::Vector3i::Ones();
      if (mesh.normals.empty()) {
        stream << fmt::format("f {} {} {}\n", f[0], f[1], f[2]);
      } else {
        stream << fmt::format("f {0}//{0} {1}//{1} {2}//{2}\n", f[0], f[1], f[2]);
      }
    }
    return {};
  });
}

}  // namespace fringe_fusion::internal
