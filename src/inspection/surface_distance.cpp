#include "fringe_fusion/inspection/surface_distance.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <unordered_map>

#include "embree_scene.hpp"

namespace fringe_fusion {
namespace {

using Key = std::array<std::uint32_t, 3>;

struct KeyHash {
  std::size_t operator()(const Key& key) const {
    std::uint64_t hash = 14695981039346656037ULL;
    for (const std::uint32_t word : key) hash = (hash ^ word) * 1099511628211ULL;
    return static_cast<std::size_t>(hash ^ (hash >> 29U));
  }
};

// Number of the first vertex with the same coordinates: a mesh whose triangles share no vertices
// would have no inner edges, and the sign would fail along all of them.
std::vector<int> WeldVertices(const std::vector<Eigen::Vector3f>& vertices) {
  std::unordered_map<Key, int, KeyHash> first;
  first.reserve(vertices.size());
  std::vector<int> welded(vertices.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const Eigen::Vector3f clean = vertices[i] + Eigen::Vector3f::Zero();  // -0 becomes 0
    Key key{};
    std::memcpy(key.data(), clean.data(), sizeof(key));
    welded[i] = first.emplace(key, static_cast<int>(i)).first->second;
  }
  return welded;
}

Status CheckMesh(const Mesh& mesh) {
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (!mesh.vertices[i].allFinite()) return Fail("vertex {} is not finite", i);
  }
  const int num_vertices = static_cast<int>(mesh.vertices.size());
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    const Eigen::Vector3i& face = mesh.faces[i];
    if (face.minCoeff() < 0 || face.maxCoeff() >= num_vertices) {
      return Fail("face {} names the vertex {}, outside [0, {})", i,
                  face.minCoeff() < 0 ? face.minCoeff() : face.maxCoeff(), num_vertices);
    }
  }
  return {};
}

double AngleAt(const Eigen::Vector3d& corner, const Eigen::Vector3d& p, const Eigen::Vector3d& q) {
  const Eigen::Vector3d a = p - corner;
  const Eigen::Vector3d b = q - corner;
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

TrianglePoint ClosestOnTriangle(const Eigen::Vector3d& query, const Eigen::Vector3d& a,
                                const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const std::array<Eigen::Vector3d, 3> corners = {a, b, c};
  const Eigen::Vector3d normal = (b - a).cross(c - a);
  bool inside = normal.squaredNorm() > 0.0;
  for (std::size_t k = 0; k < 3 && inside; ++k) {
    const Eigen::Vector3d& from = corners[k];
    inside = normal.cross(corners[(k + 1) % 3] - from).dot(query - from) >= 0.0;
  }
  if (inside) {
    return {query - normal * (normal.dot(query - a) / normal.squaredNorm()), 0};
  }
  // Outside the prism over the triangle the nearest point lies on the nearest of the three edges.
  TrianglePoint best;
  double best_squared = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d& from = corners[static_cast<std::size_t>(k)];
    const Eigen::Vector3d edge = corners[static_cast<std::size_t>((k + 1) % 3)] - from;
    const double length_squared = edge.squaredNorm();
    const double t = length_squared > 0.0 ? edge.dot(query - from) / length_squared : 0.0;
    TrianglePoint candidate;
    if (t <= 0.0) {
      candidate = {from, 1 + k};
    } else if (t >= 1.0) {
      candidate = {corners[static_cast<std::size_t>((k + 1) % 3)], 1 + (k + 1) % 3};
    } else {
      candidate = {from + t * edge, 4 + k};
    }
    const double squared = (query - candidate.point).squaredNorm();
    if (squared < best_squared) {
      best_squared = squared;
      best = candidate;
    }
  }
  return best;
}

struct SurfaceDistance::Impl {
  // What the callback of one point query collects.
  struct Search {
    const Impl* impl = nullptr;
    Eigen::Vector3d query = Eigen::Vector3d::Zero();
    double best_squared = 0.0;
    int face = -1;
    TrianglePoint nearest;
  };

  Impl(internal::EmbreeScene embree, std::vector<Eigen::Vector3f> vertices_in,
       std::vector<Eigen::Vector3i> faces_in)
      : scene(std::move(embree)), vertices(std::move(vertices_in)), faces(std::move(faces_in)) {
    ComputePseudoNormals();
  }

  [[nodiscard]] Eigen::Vector3d Corner(std::size_t face, int k) const {
    return vertices[static_cast<std::size_t>(faces[face][k])].cast<double>();
  }

  void ComputePseudoNormals() {
    // Edges as (lower vertex, upper vertex, 3 face + k), sorted: twins become neighbours.
    std::vector<std::array<int, 3>> edges;
    edges.reserve(3 * faces.size());
    face_normals.resize(faces.size());
    vertex_normals.assign(vertices.size(), Eigen::Vector3d::Zero());
    for (std::size_t f = 0; f < faces.size(); ++f) {
      const std::array<Eigen::Vector3d, 3> p = {Corner(f, 0), Corner(f, 1), Corner(f, 2)};
      face_normals[f] = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
      for (int k = 0; k < 3; ++k) {
        const auto a = static_cast<std::size_t>(k);
        const double angle = AngleAt(p[a], p[(a + 1) % 3], p[(a + 2) % 3]);
        vertex_normals[static_cast<std::size_t>(faces[f][k])] += angle * face_normals[f];
        const int from = faces[f][k];
        const int to = faces[f][(k + 1) % 3];
        edges.push_back({std::min(from, to), std::max(from, to), static_cast<int>(3 * f) + k});
      }
    }
    std::sort(edges.begin(), edges.end());
    edge_normals.resize(3 * faces.size());
    for (std::size_t begin = 0; begin < edges.size();) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      std::size_t end = begin;
      while (end < edges.size() && edges[end][0] == edges[begin][0] &&
             edges[end][1] == edges[begin][1]) {
        sum += face_normals[static_cast<std::size_t>(edges[end][2] / 3)];
        ++end;
      }
      for (; begin < end; ++begin) edge_normals[static_cast<std::size_t>(edges[begin][2])] = sum;
    }
  }

  [[nodiscard]] const Eigen::Vector3d& PseudoNormal(int face, int feature) const {
    const auto f = static_cast<std::size_t>(face);
    if (feature == 0) return face_normals[f];
    if (feature <= 3) {
      return vertex_normals[static_cast<std::size_t>(faces[f][feature - 1])];
    }
    return edge_normals[3 * f + static_cast<std::size_t>(feature - 4)];
  }

  static bool Visit(RTCPointQueryFunctionArguments* arguments) {
    auto* search = static_cast<Search*>(arguments->userPtr);
    const Impl& impl = *search->impl;
    const auto f = static_cast<std::size_t>(arguments->primID);
    const TrianglePoint candidate =
        ClosestOnTriangle(search->query, impl.Corner(f, 0), impl.Corner(f, 1), impl.Corner(f, 2));
    const double squared = (search->query - candidate.point).squaredNorm();
    const auto face = static_cast<int>(f);
    // Among equals the lowest face wins, so the answer does not depend on the tree.
    if (squared > search->best_squared ||
        (squared == search->best_squared && search->face >= 0 && search->face < face)) {
      return false;
    }
    search->best_squared = squared;
    search->face = face;
    search->nearest = candidate;
    arguments->query->radius = SafeRadius(*search);
    return true;
  }

  // The tree prunes in single precision: a margin keeps every triangle that may still win.
  static float SafeRadius(const Search& search) {
    const double coordinate = search.query.cwiseAbs().maxCoeff();
    return static_cast<float>(std::sqrt(search.best_squared) * (1.0 + 1e-5) + coordinate * 1e-6);
  }

  internal::EmbreeScene scene;
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Eigen::Vector3i> faces;  // welded, with area
  std::vector<int> face_of_input;      // of faces[i] in the mesh given
  std::vector<Eigen::Vector3d> face_normals;
  std::vector<Eigen::Vector3d> edge_normals;  // 3 per face
  std::vector<Eigen::Vector3d> vertex_normals;
};

SurfaceDistance::SurfaceDistance(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SurfaceDistance::SurfaceDistance(SurfaceDistance&&) noexcept = default;
SurfaceDistance& SurfaceDistance::operator=(SurfaceDistance&&) noexcept = default;
SurfaceDistance::~SurfaceDistance() = default;

Result<SurfaceDistance> SurfaceDistance::Create(const Mesh& mesh) {
  if (Status status = CheckMesh(mesh); !status) return tl::unexpected<Error>(status.error());
  const std::vector<int> welded = WeldVertices(mesh.vertices);
  std::vector<Eigen::Vector3i> faces;
  std::vector<int> face_of_input;
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    Eigen::Vector3i face;
    std::array<Eigen::Vector3d, 3> p;
    for (int k = 0; k < 3; ++k) {
      face[k] = welded[static_cast<std::size_t>(mesh.faces[i][k])];
      p[static_cast<std::size_t>(k)] =
          mesh.vertices[static_cast<std::size_t>(face[k])].cast<double>();
    }
    if (!((p[1] - p[0]).cross(p[2] - p[0]).squaredNorm() > 0.0)) continue;
    faces.push_back(face);
    face_of_input.push_back(static_cast<int>(i));
  }
  if (faces.empty()) return Fail("none of its {} faces has an area", mesh.faces.size());
  Result<internal::EmbreeScene> scene = internal::EmbreeScene::Create(mesh.vertices, faces);
  if (!scene) return Forward(scene);
  auto impl = std::make_unique<Impl>(std::move(*scene), mesh.vertices, std::move(faces));
  impl->face_of_input = std::move(face_of_input);
  return SurfaceDistance(std::move(impl));
}

std::optional<NearestPoint> SurfaceDistance::Nearest(const Eigen::Vector3d& query,
                                                     double max_distance_m) const {
  if (!query.allFinite() || !(max_distance_m >= 0.0)) return std::nullopt;
  Impl::Search search;
  search.impl = impl_.get();
  search.query = query;
  search.best_squared = max_distance_m * max_distance_m;
  RTCPointQuery point_query;
  point_query.x = static_cast<float>(query.x());
  point_query.y = static_cast<float>(query.y());
  point_query.z = static_cast<float>(query.z());
  point_query.time = 0.0F;
  point_query.radius = Impl::SafeRadius(search);
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(impl_->scene.scene(), &point_query, &context, &Impl::Visit, &search);
  if (search.face < 0) return std::nullopt;
  NearestPoint nearest;
  nearest.point = search.nearest.point;
  nearest.face = impl_->face_of_input[static_cast<std::size_t>(search.face)];
  const Eigen::Vector3d& normal = impl_->PseudoNormal(search.face, search.nearest.feature);
  const double distance = std::sqrt(search.best_squared);
  nearest.distance_m = normal.dot(query - nearest.point) < 0.0 ? -distance : distance;
  return nearest;
}

}  // namespace fringe_fusion
