#include "fringe_fusion/surface/mesh.hpp"

#include <Eigen/Geometry>
#include <cstddef>

namespace fringe_fusion {
namespace {

// Twice the face's area as a vector along its normal.
Eigen::Vector3f FaceVector(const Mesh& mesh, const Eigen::Vector3i& face) {
  const auto vertex = [&](int corner) {
    return mesh.vertices[static_cast<std::size_t>(face[corner])];
  };
  return (vertex(1) - vertex(0)).cross(vertex(2) - vertex(0));
}

}  // namespace

std::vector<Eigen::Vector3f> ComputeNormals(const Mesh& mesh) {
  std::vector<Eigen::Vector3f> normals(mesh.vertices.size(), Eigen::Vector3f::Zero());
  for (const Eigen::Vector3i& face : mesh.faces) {
    const Eigen::Vector3f weighted = FaceVector(mesh, face);
    for (int corner = 0; corner < 3; ++corner) {
      normals[static_cast<std::size_t>(face[corner])] += weighted;
    }
  }
  for (Eigen::Vector3f& normal : normals) normal.normalize();
  return normals;
}

double Area(const Mesh& mesh) {
  double area = 0.0;
  for (const Eigen::Vector3i& face : mesh.faces) {
    area += 0.5 * static_cast<double>(FaceVector(mesh, face).norm());
  }
  return area;
}

double BoxDiagonal(const Mesh& mesh) {
  if (mesh.vertices.empty()) return 0.0;
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& vertex : mesh.vertices) box.extend(vertex);
  return static_cast<double>(box.diagonal().norm());
}

}  // namespace fringe_fusion
