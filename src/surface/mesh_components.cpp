#include "mesh_components.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

namespace fringe_fusion::internal {
namespace {

// Disjoint sets of vertices; the smallest index of a set is its root.
class VertexSets {
 public:
  explicit VertexSets(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  int Root(int vertex) {
    while (Parent(vertex) != vertex) {
      Parent(vertex) = Parent(Parent(vertex));
      vertex = Parent(vertex);
    }
    return vertex;
  }
  void Join(int a, int b) {
    a = Root(a);
    b = Root(b);
    Parent(std::max(a, b)) = std::min(a, b);
  }

 private:
  int& Parent(int vertex) { return parent_[static_cast<std::size_t>(vertex)]; }
  std::vector<int> parent_;
};

template <typename T>
std::vector<T> Keep(const std::vector<T>& values, const std::vector<std::size_t>& kept) {
  std::vector<T> result;
  if (values.empty()) return result;
  result.reserve(kept.size());
  for (const std::size_t index : kept) result.push_back(values[index]);
  return result;
}

// The given faces with the vertices they use.
Mesh Select(const Mesh& mesh, const std::vector<std::size_t>& kept_faces) {
  std::vector<int> new_index(mesh.vertices.size(), -1);
  for (const std::size_t face : kept_faces) {
    for (const int vertex : mesh.faces[face]) new_index[static_cast<std::size_t>(vertex)] = 0;
  }
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < new_index.size(); ++i) {
    if (new_index[i] < 0) continue;
    new_index[i] = static_cast<int>(kept.size());
    kept.push_back(i);
  }
  Mesh selected;
  selected.vertices = Keep(mesh.vertices, kept);
  selected.normals = Keep(mesh.normals, kept);
  selected.colors = Keep(mesh.colors, kept);
  selected.sigma = Keep(mesh.sigma, kept);
  selected.num_views = Keep(mesh.num_views, kept);
  selected.filled_faces = Keep(mesh.filled_faces, kept_faces);
  selected.faces = Keep(mesh.faces, kept_faces);
  for (Eigen::Vector3i& face : selected.faces) {
    for (int& vertex : face) vertex = new_index[static_cast<std::size_t>(vertex)];
  }
  return selected;
}

}  // namespace

ComponentResult RemoveSmallComponents(const Mesh& mesh, int min_faces) {
  VertexSets sets(mesh.vertices.size());
  for (const Eigen::Vector3i& face : mesh.faces) {
    sets.Join(face[0], face[1]);
    sets.Join(face[0], face[2]);
  }
  std::vector<int> num_faces(mesh.vertices.size(), 0);
  const auto count_of = [&](const Eigen::Vector3i& face) -> int& {
    return num_faces[static_cast<std::size_t>(sets.Root(face[0]))];
  };
  for (const Eigen::Vector3i& face : mesh.faces) ++count_of(face);

  ComponentResult result;
  for (const int count : num_faces) {
    if (count == 0) continue;
    ++result.num_components;
    if (count < min_faces) ++result.num_removed;
    result.largest_faces = std::max(result.largest_faces, count);
  }
  std::vector<std::size_t> kept_faces;
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    if (count_of(mesh.faces[i]) >= min_faces) kept_faces.push_back(i);
  }
  result.mesh = Select(mesh, kept_faces);
  return result;
}

}  // namespace fringe_fusion::internal
