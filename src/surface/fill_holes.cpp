#include "fringe_fusion/surface/fill_holes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <utility>

#include "filled_field.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "harmonic_fill.hpp"
#include "mesh_components.hpp"

namespace fringe_fusion {

using internal::FilledField;
using internal::Space;
using internal::SpaceGrid;

namespace {

Eigen::AlignedBox3d BoxOf(const Mesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3f& vertex : mesh.vertices) box.extend(vertex.cast<double>());
  return box;
}

SpaceGrid MakeGrid(const Eigen::AlignedBox3d& box, double voxel_m, const FillConfig& config) {
  SpaceGrid grid;
  grid.step =
      std::max(config.grid_voxels * voxel_m, box.sizes().maxCoeff() / (config.max_cells - 1));
  for (std::size_t a = 0; a < 3; ++a) {
    const double cells = box.sizes()[static_cast<int>(a)] / grid.step;
    grid.size[a] = static_cast<int>(std::ceil(cells)) + 1;
    // Nodes lie evenly about the middle of the box.
    grid.origin[static_cast<int>(a)] =
        box.center()[static_cast<int>(a)] - 0.5 * grid.step * (grid.size[a] - 1);
  }
  return grid;
}

struct SpaceValues {
  std::vector<Space> states;
  std::vector<float> values;
};

constexpr int kVoxelsPerBlock =
    VoxelField::kBlockSize * VoxelField::kBlockSize * VoxelField::kBlockSize;

std::array<int, 3> VoxelInBlock(const VoxelField::BlockIndex& block, int index) {
  constexpr int kSize = VoxelField::kBlockSize;
  return {block[0] * kSize + index % kSize, block[1] * kSize + index / kSize % kSize,
          block[2] * kSize + index / (kSize * kSize)};
}

Eigen::Vector3d PositionOf(const std::array<int, 3>& voxel, double voxel_m) {
  return Eigen::Vector3d(voxel[0], voxel[1], voxel[2]) * voxel_m;
}

constexpr std::uint64_t kNoVoxel = std::numeric_limits<std::uint64_t>::max();

// For every node the supported voxel of its cell that lies nearest to it, as block and index: where
// the cells are coarser than the band of the field is deep, no node itself need lie behind a
// surface.
std::vector<std::uint64_t> NearestVoxels(const VoxelField& field, const SpaceGrid& grid,
                                         const std::vector<VoxelField::BlockIndex>& blocks) {
  constexpr int kPadded = VoxelField::kPaddedSize;
  constexpr int kSize = VoxelField::kBlockSize;
  std::vector<std::uint64_t> nearest(grid.count(), kNoVoxel);
  std::vector<float> least(grid.count(), std::numeric_limits<float>::infinity());
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const VoxelField::PaddedDistances distances = field.DistancesOf(blocks[b]);
    for (int i = 0; i < kVoxelsPerBlock; ++i) {
      const int padded =
          ((i / (kSize * kSize)) * kPadded + i / kSize % kSize) * kPadded + i % kSize;
      if (!std::isfinite(distances[static_cast<std::size_t>(padded)])) continue;
      const Eigen::Vector3d at =
          (PositionOf(VoxelInBlock(blocks[b], i), field.voxel_m()) - grid.origin) / grid.step;
      const Eigen::Vector3i node = at.array().round().cast<int>();
      if (node.minCoeff() < 0 || node.x() >= grid.size[0] || node.y() >= grid.size[1] ||
          node.z() >= grid.size[2]) {
        continue;
      }
      const std::size_t n = grid.Index(node.x(), node.y(), node.z());
      const auto distance = static_cast<float>((at - node.cast<double>()).squaredNorm());
      if (!(distance < least[n])) continue;
      least[n] = distance;
      nearest[n] = b * kVoxelsPerBlock + static_cast<std::uint64_t>(i);
    }
  }
  return nearest;
}

SpaceValues Classify(const VoxelField& field, const SpaceGrid& grid,
                     const std::vector<const View*>& views, const FillConfig& config) {
  SpaceValues space;
  space.states.assign(grid.count(), Space::kUnknown);
  space.values.assign(grid.count(), 0.0F);
  const std::vector<VoxelField::BlockIndex> blocks = field.Blocks();
  const std::vector<std::uint64_t> nearest = NearestVoxels(field, grid, blocks);
  ParallelFor(grid.size[2], 1, [&](int begin, int end) {
    for (int z = begin; z < end; ++z) {
      for (int y = 0; y < grid.size[1]; ++y) {
        for (int x = 0; x < grid.size[0]; ++x) {
          const std::size_t n = grid.Index(x, y, z);
          if (nearest[n] == kNoVoxel) continue;
          const std::array<int, 3> voxel = VoxelInBlock(
              blocks[nearest[n] / kVoxelsPerBlock], static_cast<int>(nearest[n] % kVoxelsPerBlock));
          const FieldSample at = field.AtVoxel(voxel);
          const Eigen::Vector3d from = grid.At(x, y, z) - PositionOf(voxel, field.voxel_m());
          const float length = at.gradient.norm();
          const float slope = length > 0.0F ? at.gradient.dot(from.cast<float>()) / length : 0.0F;
          space.states[n] = Space::kSeen;
          space.values[n] = at.distance + slope;
        }
      }
    }
  });
  internal::CarveEmpty(grid, views, config.clearance_cells * grid.step, space.states);
  return space;
}

void SolveUnknown(const SpaceGrid& grid, int sweeps, SpaceValues& space) {
  constexpr int kMaxDepth = 6;
  const std::vector<float> depth = internal::DepthOfEmpty(grid, space.states, kMaxDepth);
  internal::FillProblem problem;
  problem.grid = grid;
  problem.value = space.values;
  problem.fixed.assign(grid.count(), 0);
  problem.lower.assign(grid.count(), -std::numeric_limits<float>::infinity());
  for (std::size_t i = 0; i < grid.count(); ++i) {
    if (space.states[i] == Space::kSeen) problem.fixed[i] = 1;
    // The cell of an empty node is empty as far as half a step from it.
    if (space.states[i] == Space::kEmpty) {
      problem.lower[i] = (depth[i] - 0.5F) * static_cast<float>(grid.step);
    }
  }
  space.values = internal::SolveHarmonic(problem, sweeps);
}

std::vector<std::uint8_t> FlagFaces(const Mesh& mesh, const FilledField& field) {
  std::vector<std::uint8_t> filled(mesh.faces.size(), 0);
  ParallelFor(static_cast<int>(mesh.faces.size()), 4096, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      Eigen::Vector3d middle = Eigen::Vector3d::Zero();
      for (const int v : mesh.faces[i]) {
        middle += mesh.vertices[static_cast<std::size_t>(v)].cast<double>() / 3.0;
      }
      const Eigen::Vector3i cell = (middle / field.voxel_m()).array().floor().cast<int>();
      filled[i] = field.IsMeasured({cell[0], cell[1], cell[2]}) ? 0 : 1;
    }
  });
  return filled;
}

// Filled faces that hang together, and the rims at which they meet measured ones.
class Patches {
 public:
  explicit Patches(const Mesh& mesh) : mesh_(mesh), parent_(mesh.vertices.size()) {
    std::iota(parent_.begin(), parent_.end(), 0);
    std::vector<std::uint8_t> measured(mesh.vertices.size(), 0);
    for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
      if (mesh.filled_faces[i] != 0) continue;
      for (const int v : mesh.faces[i]) measured[static_cast<std::size_t>(v)] = 1;
    }
    for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
      if (mesh.filled_faces[i] == 0) continue;
      const Eigen::Vector3i& face = mesh.faces[i];
      Join(face[0], face[1]);
      Join(face[0], face[2]);
    }
    rims_.resize(mesh.vertices.size());
    for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
      if (mesh.filled_faces[i] == 0) continue;
      for (const int v : mesh.faces[i]) {
        if (measured[static_cast<std::size_t>(v)] == 0) continue;
        rims_[static_cast<std::size_t>(Root(v))].extend(mesh.vertices[static_cast<std::size_t>(v)]);
      }
    }
  }
  int Root(int vertex) {
    while (parent_[static_cast<std::size_t>(vertex)] != vertex) {
      int& up = parent_[static_cast<std::size_t>(vertex)];
      up = parent_[static_cast<std::size_t>(up)];
      vertex = up;
    }
    return vertex;
  }
  // Size of the hole [m]; infinite where no rim joins the patch to what was measured.
  double SizeOf(std::size_t face) {
    const Eigen::AlignedBox3f& rim = rims_[static_cast<std::size_t>(Root(mesh_.faces[face][0]))];
    if (rim.isEmpty()) return std::numeric_limits<double>::infinity();
    return static_cast<double>(rim.diagonal().norm());
  }

 private:
  void Join(int a, int b) {
    a = Root(a);
    b = Root(b);
    parent_[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
  }
  const Mesh& mesh_;
  std::vector<int> parent_;
  std::vector<Eigen::AlignedBox3f> rims_;
};

// Takes away the patches that close no hole and those above the size limit.
Mesh KeepPatches(const Mesh& mesh, const FillConfig& config, FillFigures& figures) {
  Patches patches(mesh);
  Mesh kept = mesh;
  kept.faces.clear();
  kept.filled_faces.clear();
  std::vector<std::uint8_t> counted(mesh.vertices.size(), 0);
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    if (mesh.filled_faces[i] != 0) {
      const double size = patches.SizeOf(i);
      if (std::isinf(size)) continue;
      const bool fits = config.watertight || size <= config.max_hole_m;
      std::uint8_t& seen = counted[static_cast<std::size_t>(patches.Root(mesh.faces[i][0]))];
      if (seen == 0) ++(fits ? figures.num_filled : figures.num_left);
      seen = 1;
      if (!fits) continue;
      ++figures.num_filled_faces;
    }
    kept.faces.push_back(mesh.faces[i]);
    kept.filled_faces.push_back(mesh.filled_faces[i]);
  }
  return kept;
}

std::size_t CountOpenEdges(const Mesh& mesh) {
  std::vector<std::pair<int, int>> edges;
  edges.reserve(mesh.faces.size() * 3);
  for (const Eigen::Vector3i& face : mesh.faces) {
    for (int k = 0; k < 3; ++k) {
      const int a = face[k];
      const int b = face[(k + 1) % 3];
      edges.emplace_back(std::min(a, b), std::max(a, b));
    }
  }
  std::sort(edges.begin(), edges.end());
  std::size_t open = 0;
  for (std::size_t begin = 0; begin < edges.size();) {
    std::size_t end = begin;
    while (end < edges.size() && edges[end] == edges[begin]) ++end;
    if (end - begin == 1) ++open;
    begin = end;
  }
  return open;
}

}  // namespace

Result<FilledSurface> FillHoles(const VoxelField& field, const std::vector<View>& views,
                                const FillConfig& config, const SurfaceConfig& surface,
                                const Progress& progress) {
  std::vector<const View*> pointers;
  for (const View& view : views) pointers.push_back(&view);
  return FillHoles(field, pointers, config, surface, progress);
}

Result<FilledSurface> FillHoles(const VoxelField& field, const std::vector<const View*>& views,
                                const FillConfig& config, const SurfaceConfig& surface,
                                const Progress& progress) {
  if (Status status = CheckBounds(config, "fill"); !status) return Forward(status);
  for (const View* view : views) {
    if (Status status = Validate(*view); !status) return Forward(status);
  }
  const Result<Mesh> open = ExtractMesh(field, surface, progress);
  if (!open) return Forward(open);
  FilledSurface result;
  Eigen::AlignedBox3d box = BoxOf(*open);
  const SpaceGrid grid = MakeGrid(box, field.voxel_m(), config);
  if (!progress("fill holes", 0.1)) return Fail("{}", kCancelled);
  SpaceValues space = Classify(field, grid, views, config);
  result.figures.grid_m = grid.step;
  for (const Space state : space.states) {
    if (state == Space::kEmpty) ++result.figures.num_empty;
    if (state == Space::kUnknown) ++result.figures.num_unknown;
  }
  if (!progress("fill holes", 0.4)) return Fail("{}", kCancelled);
  SolveUnknown(grid, config.sweeps, space);
  if (!progress("fill holes", 0.7)) return Fail("{}", kCancelled);
  box.extend(box.max() + Eigen::Vector3d::Constant(0.5 * field.voxel_m()));
  box.extend(box.min() - Eigen::Vector3d::Constant(0.5 * field.voxel_m()));
  const FilledField filled(field, box, grid, std::move(space.states), std::move(space.values));
  Result<Mesh> closed = ExtractMesh(filled, surface, progress);
  if (!closed) return Forward(closed);
  closed->filled_faces = FlagFaces(*closed, filled);
  result.mesh = internal::RemoveSmallComponents(KeepPatches(*closed, config, result.figures),
                                                surface.min_component_faces)
                    .mesh;
  result.figures.num_open_edges = CountOpenEdges(result.mesh);
  if (!progress("fill holes", 1.0)) return Fail("{}", kCancelled);
  return result;
}

}  // namespace fringe_fusion
