#include "fringe_fusion/inspection/visible_faces.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <sstream>

#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/mesh_io.hpp"

namespace fringe_fusion {
namespace {

using Corner = std::array<float, 3>;
using Corners = std::array<Corner, 3>;

/// The corners of a face, starting from the smallest, so that the same triangle compares equal
/// however its indices are rotated.
Corners FaceCorners(const Mesh& mesh, const Eigen::Vector3i& face) {
  Corners corners;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3f& vertex = mesh.vertices[static_cast<std::size_t>(face[i])];
    corners[static_cast<std::size_t>(i)] = {vertex.x(), vertex.y(), vertex.z()};
  }
  std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
  return corners;
}

std::vector<Corners> SortedFaces(const Mesh& mesh) {
  std::vector<Corners> faces;
  faces.reserve(mesh.faces.size());
  for (const Eigen::Vector3i& face : mesh.faces) faces.push_back(FaceCorners(mesh, face));
  std::sort(faces.begin(), faces.end());
  return faces;
}

Result<std::vector<std::uint8_t>> ReadFlags(const std::string& path, std::size_t num_faces) {
  const Result<std::string> text = ReadFile(path);
  if (!text) return Forward(text);
  std::vector<std::uint8_t> flags;
  std::istringstream stream(*text);
  for (std::string word; stream >> word;) {
    if (word != "0" && word != "1") {
      return Fail("{}: flag {} is '{}', must be 0 or 1", path, flags.size(), word);
    }
    flags.push_back(word == "1" ? 1 : 0);
  }
  if (flags.size() != num_faces) {
    return Fail("{}: has {} flags, the reference has {} faces", path, flags.size(), num_faces);
  }
  return flags;
}

}  // namespace

Result<std::vector<std::uint8_t>> MarkFaces(const Mesh& mesh, const Mesh& part) {
  if (part.faces.empty()) return Fail("has no faces");
  const std::vector<Corners> wanted = SortedFaces(part);
  std::vector<std::uint8_t> is_found(wanted.size(), 0);
  std::vector<std::uint8_t> flags(mesh.faces.size(), 0);
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    const auto range =
        std::equal_range(wanted.begin(), wanted.end(), FaceCorners(mesh, mesh.faces[i]));
    flags[i] = range.first != range.second ? 1 : 0;
    for (auto it = range.first; it != range.second; ++it) {
      is_found[static_cast<std::size_t>(it - wanted.begin())] = 1;
    }
  }
  const auto num_lost = std::count(is_found.begin(), is_found.end(), 0);
  if (num_lost > 0) {
    return Fail("{} of its {} faces are no faces of the reference", num_lost, wanted.size());
  }
  return flags;
}

Result<std::vector<std::uint8_t>> ReadVisibleFaces(const std::string& path, const Mesh& reference,
                                                   double unit_m) {
  if (std::filesystem::path(path).extension() == ".txt") {
    return ReadFlags(path, reference.faces.size());
  }
  const Result<Mesh> part = ReadMesh(path, unit_m);
  if (!part) return Forward(part);
  auto flags = MarkFaces(reference, *part);
  if (!flags) return Fail("{}: {}", path, flags.error().message);
  return flags;
}

}  // namespace fringe_fusion
