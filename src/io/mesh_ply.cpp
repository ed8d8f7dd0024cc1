#include <array>
#include <cmath>

#include "fringe_fusion/io/file.hpp"
#include "little_endian.hpp"
#include "mesh_formats.hpp"
#include "ply.hpp"

namespace fringe_fusion::internal {
namespace {

// Columns of the vertex element, -1 where missing.
struct VertexColumns {
  std::array<int, 3> position{};
  std::array<int, 3> normal{};
  std::array<int, 3> color{};
  int sigma = -1;
  int num_views = -1;
  bool color_is_float = false;
};

std::array<int, 3> FindThree(const PlyElement& element, const char* a, const char* b,
                             const char* c) {
  const std::array<int, 3> columns = {element.Find(a), element.Find(b), element.Find(c)};
  for (const int column : columns) {
    if (column < 0 || element.properties[static_cast<std::size_t>(column)].is_list) {
      return {-1, -1, -1};
    }
  }
  return columns;
}

VertexColumns FindColumns(const PlyElement& vertex) {
  VertexColumns columns;
  columns.position = FindThree(vertex, "x", "y", "z");
  columns.normal = FindThree(vertex, "nx", "ny", "nz");
  columns.color = FindThree(vertex, "red", "green", "blue");
  columns.sigma = vertex.Find("sigma");
  columns.num_views = vertex.Find("num_views");
  if (columns.color[0] >= 0) {
    const PlyType type = vertex.properties[static_cast<std::size_t>(columns.color[0])].type;
    columns.color_is_float = type == PlyType::kFloat32 || type == PlyType::kFloat64;
  }
  return columns;
}

double Scalar(const PlyRow& row, int column) {
  const std::vector<double>& values = row[static_cast<std::size_t>(column)];
  return values.empty() ? 0.0 : values[0];
}

Eigen::Vector3f Vector(const PlyRow& row, const std::array<int, 3>& columns) {
  return {static_cast<float>(Scalar(row, columns[0])), static_cast<float>(Scalar(row, columns[1])),
          static_cast<float>(Scalar(row, columns[2]))};
}

std::uint8_t ToByte(double value) {
  return static_cast<std::uint8_t>(std::lround(std::min(255.0, std::max(0.0, value))));
}

Status AppendVertex(const VertexColumns& columns, const PlyRow& row, const std::string& path,
                    Mesh& mesh) {
  const Eigen::Vector3f vertex = Vector(row, columns.position);
  if (!vertex.allFinite()) {
    return Fail("{}: vertex {} is not finite: {} {} {}", path, mesh.vertices.size(), vertex.x(),
                vertex.y(), vertex.z());
  }
  if (columns.normal[0] >= 0) {
    const Eigen::Vector3f normal = Vector(row, columns.normal);
    if (!normal.allFinite()) {
      return Fail("{}: the normal of vertex {} is not finite", path, mesh.vertices.size());
    }
    mesh.normals.push_back(normal);
  }
  mesh.vertices.push_back(vertex);
  if (columns.color[0] >= 0) {
    const double scale = columns.color_is_float ? 255.0 : 1.0;
    mesh.colors.push_back({ToByte(scale * Scalar(row, columns.color[0])),
                           ToByte(scale * Scalar(row, columns.color[1])),
                           ToByte(scale * Scalar(row, columns.color[2]))});
  }
  if (columns.sigma >= 0) {
    mesh.sigma.push_back(static_cast<float>(Scalar(row, columns.sigma)));
  }
  if (columns.num_views >= 0) mesh.num_views.push_back(ToByte(Scalar(row, columns.num_views)));
  return {};
}

Result<Mesh> ReadMeshElements(const PlyReader& reader, const std::string& path) {
  const PlyElement* vertex = reader.Find("vertex");
  if (vertex == nullptr) return Fail("{}: has no element 'vertex'", path);
  if (reader.Find("tristrips") != nullptr) return Fail("{}: triangle strips are not read", path);
  const VertexColumns columns = FindColumns(*vertex);
  if (columns.position[0] < 0) return Fail("{}: element vertex has no x, y, z", path);
  int corners = -1;
  int filled = -1;
  if (const PlyElement* face = reader.Find("face")) {
    corners = std::max(face->Find("vertex_indices"), face->Find("vertex_index"));
    filled = face->Find("filled");
    if (corners < 0 && face->count > 0) {
      return Fail("{}: element face has no vertex_indices", path);
    }
  }
  Mesh mesh;
  mesh.vertices.reserve(vertex->count);
  const Status status = reader.ReadRows(
      [&](const PlyElement& element, std::size_t index, const PlyRow& row) -> Status {
        if (element.name == "vertex") return AppendVertex(columns, row, path, mesh);
        if (element.name != "face") return {};
        Status appended = AppendPolygon(row[static_cast<std::size_t>(corners)], vertex->count,
                                        fmt::format("{}: face {}", path, index), mesh.faces);
        if (filled >= 0) {
          mesh.filled_faces.resize(mesh.faces.size(), ToByte(Scalar(row, filled)));
        }
        return appended;
      });
  if (!status) return tl::unexpected<Error>(status.error());
  return mesh;
}

void PutVector(std::string& bytes, const Eigen::Vector3f& vector) {
  for (int k = 0; k < 3; ++k) PutFloat(bytes, vector[k]);
}

}  // namespace

PlyColumns ColumnsOf(const Mesh& mesh) {
  return {!mesh.normals.empty(), !mesh.colors.empty(), !mesh.sigma.empty(), !mesh.num_views.empty(),
          !mesh.filled_faces.empty()};
}

std::string MeshPlyHeader(std::size_t num_vertices, std::size_t num_faces,
                          const PlyColumns& columns) {
  std::string text = "ply\nformat binary_little_endian 1.0\ncomment fringe_fusion, metres\n";
  text += fmt::format("element vertex {}\n", num_vertices);
  text += "property float x\nproperty float y\nproperty float z\n";
  if (columns.normals) text += "property float nx\nproperty float ny\nproperty float nz\n";
  if (columns.colors) text += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  if (columns.sigma) text += "property float sigma\n";
  if (columns.num_views) text += "property uchar num_views\n";
  text += fmt::format("element face {}\nproperty list uchar int vertex_indices\n", num_faces);
  if (columns.filled) text += "property uchar filled\n";
  return text + "end_header\n";
}

void PutPlyVertex(const Mesh& mesh, std::size_t i, std::string& bytes) {
  PutVector(bytes, mesh.vertices[i]);
  if (!mesh.normals.empty()) PutVector(bytes, mesh.normals[i]);
  if (!mesh.colors.empty()) {
    PutByte(bytes, mesh.colors[i].r);
    PutByte(bytes, mesh.colors[i].g);
    PutByte(bytes, mesh.colors[i].b);
  }
  if (!mesh.sigma.empty()) PutFloat(bytes, mesh.sigma[i]);
  if (!mesh.num_views.empty()) PutByte(bytes, mesh.num_views[i]);
}

Result<Mesh> ReadMeshPly(const std::string& path) {
  const Result<PlyReader> reader = PlyReader::Open(path);
  if (!reader) return Forward(reader);
  return ReadMeshElements(*reader, path);
}

Status WriteMeshPly(const Mesh& mesh, const std::string& path) {
  std::string bytes = MeshPlyHeader(mesh.vertices.size(), mesh.faces.size(), ColumnsOf(mesh));
  bytes.reserve(bytes.size() + mesh.vertices.size() * 32 + mesh.faces.size() * 14);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) PutPlyVertex(mesh, i, bytes);
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    PutByte(bytes, 3);
    for (int k = 0; k < 3; ++k) PutInt32(bytes, mesh.faces[i][k]);
    if (!mesh.filled_faces.empty()) PutByte(bytes, mesh.filled_faces[i]);
  }
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return {};
  });
}

}  // namespace fringe_fusion::internal
