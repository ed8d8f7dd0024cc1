#include "fringe_fusion/surface/extract_mesh.hpp"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "cube_table.hpp"
#include "edge_mesh.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "mesh_components.hpp"

namespace fringe_fusion {
namespace {

using internal::CubeTable;
using internal::EdgeKey;
using internal::EdgeMesh;

using EdgeTriangle = std::array<EdgeKey, 3>;
constexpr int kCoordinateBits = 20;
constexpr int kCoordinateBias = 1 << (kCoordinateBits - 1);

struct GridEdge {
  std::array<int, 3> voxel{};
  int axis = 0;
};

EdgeKey Pack(const GridEdge& edge) {
  EdgeKey key = 0;
  for (const int coordinate : edge.voxel) {
    key = (key << kCoordinateBits) | static_cast<EdgeKey>(coordinate + kCoordinateBias);
  }
  return (key << 2) | static_cast<EdgeKey>(edge.axis);
}

GridEdge Unpack(EdgeKey key) {
  constexpr EdgeKey kMask = (EdgeKey{1} << kCoordinateBits) - 1;
  GridEdge edge;
  edge.axis = static_cast<int>(key & 3);
  for (std::size_t a = 0; a < 3; ++a) {
    const auto shift = 2 + kCoordinateBits * (2 - static_cast<int>(a));
    edge.voxel[a] = static_cast<int>((key >> shift) & kMask) - kCoordinateBias;
  }
  return edge;
}

class BlockCells {
 public:
  BlockCells(const VoxelField& model, const VoxelField::BlockIndex& block)
      : distances_(model.DistancesOf(block)),
        block_(block),
        max_jump_(static_cast<float>(kMaxJumpVoxels * model.voxel_m())) {}

  void AppendTriangles(const CubeTable& table, std::vector<EdgeTriangle>& triangles) const {
    for (int z = 0; z < VoxelField::kBlockSize; ++z) {
      for (int y = 0; y < VoxelField::kBlockSize; ++y) {
        for (int x = 0; x < VoxelField::kBlockSize; ++x) {
          AppendCell(table, {x, y, z}, triangles);
        }
      }
    }
  }

 private:
  // A distance changes by at most one voxel from voxel to voxel. A larger jump through zero lies
  // between two sheets, not on a surface.
  static constexpr double kMaxJumpVoxels = 1.8;

  void AppendCell(const CubeTable& table, const std::array<int, 3>& cell,
                  std::vector<EdgeTriangle>& triangles) const {
    std::array<float, internal::kCubeCorners> corners{};
    unsigned pattern = 0;
    for (int c = 0; c < internal::kCubeCorners; ++c) {
      const auto index = static_cast<std::size_t>(
          ((cell[2] + (c >> 2)) * kSize + cell[1] + ((c >> 1) & 1)) * kSize + cell[0] + (c & 1));
      const float distance = distances_[index];
      if (!std::isfinite(distance)) return;
      corners[static_cast<std::size_t>(c)] = distance;
      if (distance < 0.0F) pattern |= 1U << c;
    }
    if (pattern == 0 || pattern == 255 || HasJump(corners)) return;
    for (const CubeTable::Triangle& triangle : table[pattern]) {
      triangles.push_back(
          {KeyOf(cell, triangle[0]), KeyOf(cell, triangle[1]), KeyOf(cell, triangle[2])});
    }
  }

  [[nodiscard]] bool HasJump(const std::array<float, internal::kCubeCorners>& corners) const {
    for (int e = 0; e < internal::kCubeEdges; ++e) {
      const internal::CubeEdge edge = internal::GetCubeEdge(e);
      const float a = corners[static_cast<std::size_t>(edge.from)];
      const float b = corners[static_cast<std::size_t>(edge.to)];
      if ((a < 0.0F) != (b < 0.0F) && std::abs(a - b) > max_jump_) return true;
    }
    return false;
  }

  [[nodiscard]] EdgeKey KeyOf(const std::array<int, 3>& cell, int e) const {
    const internal::CubeEdge edge = internal::GetCubeEdge(e);
    GridEdge grid;
    grid.axis = edge.axis;
    for (int a = 0; a < 3; ++a) {
      const auto axis = static_cast<std::size_t>(a);
      grid.voxel[axis] =
          block_[axis] * VoxelField::kBlockSize + cell[axis] + ((edge.from >> a) & 1);
    }
    return Pack(grid);
  }

  static constexpr int kSize = VoxelField::kPaddedSize;
  VoxelField::PaddedDistances distances_;
  VoxelField::BlockIndex block_;
  float max_jump_;
};

Result<std::vector<EdgeTriangle>> FindTriangles(const VoxelField& model, const Progress& progress) {
  const std::vector<VoxelField::BlockIndex> blocks = model.Blocks();
  const CubeTable table;
  constexpr int kBatch = 1024;
  constexpr int kGrain = 16;
  const auto count = static_cast<int>(blocks.size());
  std::vector<EdgeTriangle> triangles;
  for (int start = 0; start < count; start += kBatch) {
    if (!progress("extract", static_cast<double>(start) / count)) return Fail("{}", kCancelled);
    std::vector<std::vector<EdgeTriangle>> chunks(kBatch / kGrain);
    ParallelFor(std::min(kBatch, count - start), kGrain, [&](int begin, int end) {
      for (int i = begin; i < end; ++i) {
        const BlockCells cells(model, blocks[static_cast<std::size_t>(start + i)]);
        cells.AppendTriangles(table, chunks[static_cast<std::size_t>(begin / kGrain)]);
      }
    });
    for (const auto& chunk : chunks) {
      triangles.insert(triangles.end(), chunk.begin(), chunk.end());
    }
  }
  return triangles;
}

std::vector<EdgeKey> DistinctEdges(const std::vector<EdgeTriangle>& triangles) {
  std::vector<EdgeKey> edges;
  edges.reserve(triangles.size() * 3);
  for (const EdgeTriangle& triangle : triangles) {
    edges.insert(edges.end(), triangle.begin(), triangle.end());
  }
  tbb::parallel_sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

// Root in (0, 1) of the cubic through d[0 .. 3] at -1, 0, 1, 2: the distance is not quite linear
// where the surface bends. Linear where an outer voxel is missing or the distance has a kink: half
// way through a thin rib it turns back.
float RootOnEdge(const std::array<float, 4>& d, float voxel_m) {
  const float linear = d[1] / (d[1] - d[2]);
  float root = linear;
  // Second difference of a surface with a radius of some seven voxels.
  constexpr float kMaxBendVoxels = 0.15F;
  const float max_bend = kMaxBendVoxels * voxel_m;
  // NaN, where an outer voxel is not supported, fails both.
  if (std::abs(d[0] - 2.0F * d[1] + d[2]) <= max_bend &&
      std::abs(d[1] - 2.0F * d[2] + d[3]) <= max_bend) {
    const float t = linear;
    const float cubic = d[1] + t * (-d[0] / 3.0F - d[1] / 2.0F + d[2] - d[3] / 6.0F +
                                    t * (d[0] / 2.0F - d[1] + d[2] / 2.0F +
                                         t * (-d[0] + 3.0F * d[1] - 3.0F * d[2] + d[3]) / 6.0F));
    // One secant step from the linear root.
    root = linear - cubic / (d[2] - d[1]);
  }
  // Vertices of different edges that met in a voxel would make faces without area.
  constexpr float kMargin = 1e-3F;
  return std::clamp(root, kMargin, 1.0F - kMargin);
}

void SetVertex(const VoxelField& model, const GridEdge& edge, std::size_t index, Mesh& mesh) {
  const auto axis = static_cast<std::size_t>(edge.axis);
  std::array<FieldSample, 4> samples;
  std::array<float, 4> distances{};
  for (int i = 0; i < 4; ++i) {
    std::array<int, 3> voxel = edge.voxel;
    voxel[axis] += i - 1;
    samples[static_cast<std::size_t>(i)] = model.AtVoxel(voxel);
    distances[static_cast<std::size_t>(i)] = samples[static_cast<std::size_t>(i)].distance;
  }
  const float t = RootOnEdge(distances, static_cast<float>(model.voxel_m()));
  const FieldSample& a = samples[1];
  const FieldSample& b = samples[2];
  Eigen::Vector3d position(edge.voxel[0], edge.voxel[1], edge.voxel[2]);
  position[edge.axis] += static_cast<double>(t);
  mesh.vertices[index] = (position * model.voxel_m()).cast<float>();
  const Eigen::Vector3f gradient = (1.0F - t) * a.gradient + t * b.gradient;
  const float length = gradient.norm();
  const Eigen::Vector3f along =
      Eigen::Vector3f::Unit(edge.axis) * (b.distance > a.distance ? 1.0F : -1.0F);
  mesh.normals[index] = length > 0.0F ? Eigen::Vector3f(gradient / length) : along;
  mesh.sigma[index] = (1.0F - t) * a.sigma + t * b.sigma;
  const auto mix = [&](std::uint8_t from, std::uint8_t to) {
    return static_cast<std::uint8_t>(
        std::lround((1.0F - t) * static_cast<float>(from) + t * static_cast<float>(to)));
  };
  mesh.colors[index] = {mix(a.color.r, b.color.r), mix(a.color.g, b.color.g),
                        mix(a.color.b, b.color.b)};
  mesh.num_views[index] = static_cast<std::uint8_t>(t < 0.5F ? a.num_views : b.num_views);
}

EdgeMesh MakeMesh(const VoxelField& model, const std::vector<EdgeTriangle>& triangles) {
  EdgeMesh made;
  made.edges = DistinctEdges(triangles);
  const std::vector<EdgeKey>& edges = made.edges;
  Mesh& mesh = made.mesh;
  mesh.vertices.resize(edges.size());
  mesh.normals.resize(edges.size());
  mesh.colors.resize(edges.size());
  mesh.sigma.resize(edges.size());
  mesh.num_views.resize(edges.size());
  constexpr int kGrain = 4096;
  ParallelFor(static_cast<int>(edges.size()), kGrain, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      SetVertex(model, Unpack(edges[i]), i, mesh);
    }
  });
  mesh.faces.resize(triangles.size());
  ParallelFor(static_cast<int>(triangles.size()), kGrain, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      for (int corner = 0; corner < 3; ++corner) {
        const EdgeKey key = triangles[i][static_cast<std::size_t>(corner)];
        const auto found = std::lower_bound(edges.begin(), edges.end(), key);
        mesh.faces[i][corner] = static_cast<int>(found - edges.begin());
      }
    }
  });
  return made;
}

}  // namespace

int internal::VoxelColumn(EdgeKey edge) { return Unpack(edge).voxel[0]; }

Result<EdgeMesh> internal::ExtractEdgeMesh(const VoxelField& field, const Progress& progress) {
  const Result<std::vector<EdgeTriangle>> triangles = FindTriangles(field, progress);
  if (!triangles) return Forward(triangles);
  return MakeMesh(field, *triangles);
}

Result<Mesh> ExtractMesh(const VoxelField& model, const SurfaceConfig& config,
                         const Progress& progress) {
  if (Status status = CheckBounds(config, "surface"); !status) return Forward(status);
  if (model.NumBlocks() == 0) return Fail("surface: the model is empty, add a view first");
  const Result<EdgeMesh> all = internal::ExtractEdgeMesh(model, progress);
  if (!all) return Forward(all);
  if (all->mesh.faces.empty()) {
    return Fail("surface: no cell of the {} blocks is crossed by the surface", model.NumBlocks());
  }
  if (!progress("extract", 1.0)) return Fail("{}", kCancelled);
  internal::ComponentResult components =
      internal::RemoveSmallComponents(all->mesh, config.min_component_faces);
  if (components.mesh.faces.empty()) {
    return Fail("surface: the largest of {} pieces has {} faces, limit min_component_faces = {}",
                components.num_components, components.largest_faces, config.min_component_faces);
  }
  return std::move(components.mesh);
}

}  // namespace fringe_fusion
