#include "fringe_fusion/sim/gauges.hpp"

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>

#include "common/constants.hpp"
#include "fringe_fusion/io/mesh_io.hpp"

namespace fringe_fusion::sim {
namespace {

int AddVertex(Mesh& mesh, const Eigen::Vector3d& vertex) {
  mesh.vertices.push_back(vertex.cast<float>());
  return static_cast<int>(mesh.vertices.size()) - 1;
}

void AddQuad(Mesh& mesh, int a, int b, int c, int d) {
  mesh.faces.emplace_back(a, b, c);
  mesh.faces.emplace_back(a, c, d);
}

void Append(const Mesh& part, Mesh& mesh) {
  const int offset = static_cast<int>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), part.vertices.begin(), part.vertices.end());
  for (const Eigen::Vector3i& face : part.faces) {
    mesh.faces.push_back(face + Eigen::Vector3i::Constant(offset));
  }
}

// Closed cylinder along z from z0 to z1.
Mesh MakeCylinder(double radius_m, double z0, double z1, int segments) {
  Mesh mesh;
  const int bottom = AddVertex(mesh, {0.0, 0.0, z0});
  const int top = AddVertex(mesh, {0.0, 0.0, z1});
  for (int i = 0; i < segments; ++i) {
    const double angle = 2.0 * kPi * i / segments;
    const double x = radius_m * std::cos(angle);
    const double y = radius_m * std::sin(angle);
    AddVertex(mesh, {x, y, z0});
    AddVertex(mesh, {x, y, z1});
  }
  for (int i = 0; i < segments; ++i) {
    const int low = 2 + 2 * i;
    const int next = 2 + 2 * ((i + 1) % segments);
    AddQuad(mesh, low, next, next + 1, low + 1);
    mesh.faces.emplace_back(bottom, next, low);
    mesh.faces.emplace_back(top, low + 1, next + 1);
  }
  return mesh;
}

// Unit icosahedron, outward oriented.
Mesh Icosahedron() {
  const double golden = 0.5 * (1.0 + std::sqrt(5.0));
  Mesh mesh;
  for (const double one : {-1.0, 1.0}) {
    for (const double phi : {-golden, golden}) {
      AddVertex(mesh, Eigen::Vector3d(0.0, one, phi).normalized());
      AddVertex(mesh, Eigen::Vector3d(one, phi, 0.0).normalized());
      AddVertex(mesh, Eigen::Vector3d(phi, 0.0, one).normalized());
    }
  }
  // Its faces are the triples of mutual nearest neighbours.
  const float edge = 1.1F * static_cast<float>(2.0 / std::sqrt(1.0 + golden * golden));
  const auto near = [&](int a, int b) {
    return (mesh.vertices[static_cast<std::size_t>(a)] - mesh.vertices[static_cast<std::size_t>(b)])
               .norm() < edge;
  };
  for (int a = 0; a < 12; ++a) {
    for (int b = a + 1; b < 12; ++b) {
      for (int c = b + 1; c < 12; ++c) {
        if (!near(a, b) || !near(b, c) || !near(c, a)) continue;
        Eigen::Matrix3f corners;
        corners << mesh.vertices[static_cast<std::size_t>(a)],
            mesh.vertices[static_cast<std::size_t>(b)], mesh.vertices[static_cast<std::size_t>(c)];
        if (corners.determinant() > 0.0F) {
          mesh.faces.emplace_back(a, b, c);
        } else {
          mesh.faces.emplace_back(a, c, b);
        }
      }
    }
  }
  return mesh;
}

// Splits every triangle of a mesh on the unit sphere in four.
Mesh SubdivideOnSphere(const Mesh& coarse) {
  Mesh fine;
  fine.vertices = coarse.vertices;
  std::map<std::pair<int, int>, int> middles;
  const auto middle = [&](int a, int b) {
    const auto [entry, is_new] = middles.try_emplace(std::minmax(a, b), 0);
    if (is_new) {
      const Eigen::Vector3d sum = fine.vertices[static_cast<std::size_t>(a)].cast<double>() +
                                  fine.vertices[static_cast<std::size_t>(b)].cast<double>();
      entry->second = AddVertex(fine, sum.normalized());
    }
    return entry->second;
  };
  for (const Eigen::Vector3i& face : coarse.faces) {
    const int ab = middle(face[0], face[1]);
    const int bc = middle(face[1], face[2]);
    const int ca = middle(face[2], face[0]);
    fine.faces.emplace_back(face[0], ab, ca);
    fine.faces.emplace_back(face[1], bc, ab);
    fine.faces.emplace_back(face[2], ca, bc);
    fine.faces.emplace_back(ab, bc, ca);
  }
  return fine;
}

}  // namespace

Mesh MakePlane(double side_m, int cells) {
  if (cells < 1) throw std::invalid_argument("MakePlane: cells must be at least 1");
  Mesh mesh;
  for (int j = 0; j <= cells; ++j) {
    for (int i = 0; i <= cells; ++i) {
      AddVertex(mesh, {side_m * (static_cast<double>(i) / cells - 0.5),
                       side_m * (static_cast<double>(j) / cells - 0.5), 0.0});
    }
  }
  for (int j = 0; j < cells; ++j) {
    for (int i = 0; i < cells; ++i) {
      const int corner = j * (cells + 1) + i;
      AddQuad(mesh, corner, corner + 1, corner + cells + 2, corner + cells + 1);
    }
  }
  mesh.normals = ComputeNormals(mesh);
  return mesh;
}

Mesh MakeSphere(const Eigen::Vector3d& center, double radius_m, int subdivisions) {
  if (subdivisions < 0 || subdivisions > 9) {
    throw std::invalid_argument("MakeSphere: subdivisions must be within [0, 9]");
  }
  Mesh mesh = Icosahedron();
  for (int i = 0; i < subdivisions; ++i) mesh = SubdivideOnSphere(mesh);
  mesh.normals = mesh.vertices;
  for (Eigen::Vector3f& vertex : mesh.vertices) {
    vertex = (center + radius_m * vertex.cast<double>()).cast<float>();
  }
  return mesh;
}

Mesh MakeBallBar(double length_m, double radius_m) {
  Mesh mesh;
  for (const double side : {-0.5, 0.5}) {
    Append(MakeSphere({side * length_m, 0.0, radius_m}, radius_m, 6), mesh);
  }
  Mesh bar = MakeCylinder(0.25 * radius_m, -0.5 * length_m, 0.5 * length_m, 64);
  for (Eigen::Vector3f& vertex : bar.vertices) {
    // z becomes x by a proper rotation, so that the faces stay outward oriented.
    vertex =
        Eigen::Vector3f(vertex.z(), vertex.x(), vertex.y() + static_cast<float>(radius_m)).eval();
  }
  Append(bar, mesh);
  mesh.normals = ComputeNormals(mesh);
  return mesh;
}

Mesh MakeStepBlock(int steps, double rise_m, double run_m, double depth_m) {
  if (steps < 1) throw std::invalid_argument("MakeStepBlock: steps must be at least 1");
  Mesh mesh;
  std::map<std::array<int, 3>, int> indices;
  const auto vertex = [&](int i, int j, int k) {
    const auto [entry, is_new] = indices.try_emplace({i, j, k}, 0);
    if (is_new) {
      entry->second = AddVertex(mesh, {run_m * (i - 0.5 * steps), depth_m * (j - 0.5), rise_m * k});
    }
    return entry->second;
  };
  for (int i = 0; i < steps; ++i) {
    const int top = i + 1;
    AddQuad(mesh, vertex(i, 0, top), vertex(i + 1, 0, top), vertex(i + 1, 1, top),
            vertex(i, 1, top));
    AddQuad(mesh, vertex(i, 1, 0), vertex(i + 1, 1, 0), vertex(i + 1, 0, 0), vertex(i, 0, 0));
    AddQuad(mesh, vertex(i, 1, i), vertex(i, 0, i), vertex(i, 0, top), vertex(i, 1, top));
    // The back, and the sides column by column so that no vertex lies within a neighbour's edge.
    AddQuad(mesh, vertex(steps, 0, i), vertex(steps, 1, i), vertex(steps, 1, top),
            vertex(steps, 0, top));
    for (int k = 0; k <= i; ++k) {
      AddQuad(mesh, vertex(i, 0, k), vertex(i + 1, 0, k), vertex(i + 1, 0, k + 1),
              vertex(i, 0, k + 1));
      AddQuad(mesh, vertex(i, 1, k), vertex(i, 1, k + 1), vertex(i + 1, 1, k + 1),
              vertex(i + 1, 1, k));
    }
  }
  mesh.normals = ComputeNormals(mesh);
  return mesh;
}

Mesh MakePlate(double radius_m, double thickness_m) {
  Mesh mesh = MakeCylinder(radius_m, -thickness_m, 0.0, 180);
  mesh.normals = ComputeNormals(mesh);
  return mesh;
}

Result<Mesh> MakeObject(const std::string& name_or_path) {
  if (name_or_path == "plane") return MakePlane(0.12, 60);
  if (name_or_path == "sphere") return MakeSphere({0.0, 0.0, 0.025}, 0.025, 6);
  if (name_or_path == "ball_bar") return MakeBallBar(0.07, 0.015);
  if (name_or_path == "step_block") return MakeStepBlock(5, 0.008, 0.014, 0.04);
  if (name_or_path == "freeform") return MakeFreeform(0.0006);
  if (name_or_path.find('.') == std::string::npos) {
    return Fail(
        "object '{}' is neither plane, sphere, ball_bar, step_block, freeform nor a mesh file",
        name_or_path);
  }
  return ReadMesh(name_or_path);
}

}  // namespace fringe_fusion::sim
