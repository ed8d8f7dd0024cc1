#include "fringe_fusion/io/mesh_io.hpp"

#include <cctype>
#include <cmath>
#include <filesystem>
#include <utility>

#include "extension.hpp"
#include "mesh_formats.hpp"

namespace fringe_fusion {
namespace {

Result<Mesh> ReadAsIs(const std::string& path) {
  const std::string extension = internal::LowerExtension(path);
  if (extension == ".ply") return internal::ReadMeshPly(path);
  if (extension == ".stl") return internal::ReadMeshStl(path);
  if (extension == ".obj") return internal::ReadMeshObj(path);
  if (extension == ".pcd") return internal::ReadMeshPcd(path);
  return Fail("{}: unknown mesh format '{}', must be .ply, .stl, .obj or .pcd", path, extension);
}

template <typename T>
Status CheckLength(const char* name, const std::vector<T>& values, std::size_t expected,
                   const std::string& path) {
  if (values.empty() || values.size() == expected) return {};
  return Fail("{}: the mesh has {} {}, must have none or {}", path, values.size(), name, expected);
}

// What no reader, ours included, would take back must not be written.
Status CheckMesh(const Mesh& mesh, const std::string& path) {
  const std::size_t n = mesh.vertices.size();
  for (const Status& status :
       {CheckLength("normals", mesh.normals, n, path), CheckLength("colours", mesh.colors, n, path),
        CheckLength("sigmas", mesh.sigma, n, path),
        CheckLength("view counts", mesh.num_views, n, path),
        CheckLength("face flags", mesh.filled_faces, mesh.faces.size(), path)}) {
    if (!status) return status;
  }
  for (std::size_t i = 0; i < n; ++i) {
    if (!mesh.vertices[i].allFinite()) return Fail("{}: vertex {} is not finite", path, i);
  }
  for (std::size_t i = 0; i < mesh.normals.size(); ++i) {
    if (!mesh.normals[i].allFinite()) return Fail("{}: normal {} is not finite", path, i);
  }
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    const Eigen::Vector3i& face = mesh.faces[i];
    if (face.minCoeff() < 0 || static_cast<std::size_t>(face.maxCoeff()) >= n) {
      return Fail("{}: face {} has the corner {}, outside [0, {})", path, i,
                  face.minCoeff() < 0 ? face.minCoeff() : face.maxCoeff(), n);
    }
  }
  return {};
}

Status CheckRange(const RangeImage& range, const std::string& path) {
  const auto expected =
      static_cast<std::size_t>(range.width) * static_cast<std::size_t>(range.height);
  for (const std::size_t size : {range.points.size(), range.normals.size(), range.color.size(),
                                 range.sigma_range.size(), range.sigma_lateral.size()}) {
    if (size != expected) {
      return Fail("{}: the range image is {} x {}, but a layer has {} pixels", path, range.width,
                  range.height, size);
    }
  }
  return {};
}

}  // namespace

Result<Mesh> ReadMesh(const std::string& path, double unit_m) {
  if (!(unit_m > 0.0) || !std::isfinite(unit_m)) {
    return Fail("{}: the unit is {} m, must be positive", path, unit_m);
  }
  Result<Mesh> mesh = ReadAsIs(path);
  if (!mesh || unit_m == 1.0) return mesh;
  for (std::size_t i = 0; i < mesh->vertices.size(); ++i) {
    Eigen::Vector3f& vertex = mesh->vertices[i];
    vertex = (vertex.cast<double>() * unit_m).cast<float>();
    if (!vertex.allFinite()) return Fail("{}: vertex {} is not finite in metres", path, i);
  }
  for (float& sigma : mesh->sigma) sigma = static_cast<float>(sigma * unit_m);
  return mesh;
}

Status WriteMesh(const Mesh& mesh, const std::string& path) {
  if (Status status = CheckMesh(mesh, path); !status) return status;
  const std::string extension = internal::LowerExtension(path);
  if (extension == ".ply") return internal::WriteMeshPly(mesh, path);
  if (extension == ".stl") return internal::WriteMeshStl(mesh, path);
  if (extension == ".obj") return internal::WriteMeshObj(mesh, path);
  if (extension == ".glb") return internal::WriteMeshGltf(mesh, path);
  if (extension == ".pcd") return internal::WriteMeshPcd(mesh, path);
  return Fail("{}: unknown mesh format '{}', must be .ply, .stl, .obj, .glb or .pcd", path,
              extension);
}

Result<RangeImage> ReadRangeImage(const std::string& path) {
  const std::string extension = internal::LowerExtension(path);
  if (extension == ".ply") return internal::ReadRangePly(path);
  if (extension == ".pcd") return internal::ReadRangePcd(path);
  return Fail("{}: unknown range image format '{}', must be .ply or .pcd", path, extension);
}

Status WriteRangeImage(const RangeImage& range, const std::string& path) {
  if (Status status = CheckRange(range, path); !status) return status;
  const std::string extension = internal::LowerExtension(path);
  if (extension == ".ply") return internal::WriteRangePly(range, path);
  if (extension == ".pcd") return internal::WriteRangePcd(range, path);
  return Fail("{}: unknown range image format '{}', must be .ply or .pcd", path, extension);
}

Mesh ToCloud(const RangeImage& range) {
  Mesh cloud;
  bool all_normals = true;
  bool all_sigmas = true;
  for (std::size_t i = 0; i < range.points.size(); ++i) {
    if (!range.points[i].allFinite()) continue;
    cloud.vertices.push_back(range.points[i]);
    cloud.normals.push_back(range.normals[i]);
    cloud.colors.push_back(range.color[i]);
    cloud.sigma.push_back(range.sigma_range[i]);
    all_normals = all_normals && range.normals[i].allFinite();
    all_sigmas = all_sigmas && std::isfinite(range.sigma_range[i]);
  }
  if (!all_normals) cloud.normals.clear();
  if (!all_sigmas) cloud.sigma.clear();
  return cloud;
}

}  // namespace fringe_fusion
