#include "variational_band.hpp"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::internal {
namespace {

using CenterRuns = std::vector<std::pair<BlockKey, std::int32_t>>;  // sorted

std::array<int, 3> VoxelBelow(const Eigen::Vector3d& position_voxels) {
  return {static_cast<int>(std::floor(position_voxels.x())),
          static_cast<int>(std::floor(position_voxels.y())),
          static_cast<int>(std::floor(position_voxels.z()))};
}

double ReachVoxels(const BandSettings& settings) { return settings.reach_m / settings.voxel_m; }

CenterRuns SortCenters(const std::vector<Center>& centers, const BandSettings& settings) {
  CenterRuns runs(centers.size());
  for (std::size_t i = 0; i < centers.size(); ++i) {
    const Eigen::Vector3d at = centers[i].position.cast<double>() / settings.voxel_m;
    runs[i] = {BlockOfVoxel(VoxelBelow(at)), static_cast<std::int32_t>(i)};
  }
  tbb::parallel_sort(runs.begin(), runs.end());
  return runs;
}

// A voxel as seen from a centre: how far away, and where over the tangent plane.
struct VoxelPlace {
  VoxelPlace(const Eigen::Vector3f& from, const Eigen::Vector3f& normal)
      : distance2(from.squaredNorm()),
        height(std::abs(from.dot(normal))),
        along(from - from.dot(normal) * normal) {}
  float distance2;
  float height;
  Eigen::Vector3f along;
};

// Distance of a voxel from the tangent plane up to which it serves the extraction: the corners of a
// crossed cell and one voxel more, and what the surface may bend away within the reach.
bool IsInBand(const VoxelPlace& place, float reach) {
  constexpr float kHalfBand = 1.9F;
  constexpr float kBend = 0.4F;
  if (place.distance2 > reach * reach) return false;
  return place.height <= kHalfBand + kBend * place.along.norm();
}

// The nearest centre of every voxel of a block, and where its centres lie on the average.
struct BandMarks {
  std::array<float, kVoxelsPerBlock> nearest{};
  std::array<float, kVoxelsPerBlock> weight{};
  std::array<Eigen::Vector3f, kVoxelsPerBlock> along{};  // weighted sum, voxels from centres

  BandMarks() {
    nearest.fill(std::numeric_limits<float>::infinity());
    along.fill(Eigen::Vector3f::Zero());
  }
  void Add(std::size_t i, const VoxelPlace& place, float reach) {
    const float rest = std::max(0.0F, 1.0F - place.along.squaredNorm() / (reach * reach));
    weight[i] += rest * rest;
    along[i] += rest * rest * place.along;
  }
  // At the straight rim of an even sheet the mean lies 0.29 reaches inside; where it lies farther
  // away, the centres are all on one side and the function is a guess.
  [[nodiscard]] bool IsBeyondRim(std::size_t i, float reach) const {
    constexpr float kMaxOffset = 0.45F;
    return !(along[i].norm() <= kMaxOffset * reach * weight[i]);
  }
};

class BlockMaker {
 public:
  BlockMaker(const std::vector<Center>& centers, const CenterRuns& runs, const CellTree& cells,
             const BandSettings& settings)
      : centers_(centers), runs_(runs), cells_(cells), settings_(settings) {}

  [[nodiscard]] BandBlock Make(BlockKey key) const {
    BandBlock block;
    block.key = key;
    block.voxels.resize(kVoxelsPerBlock);
    if (!Mark(block)) {
      block.voxels.clear();
      return block;
    }
    Evaluate(block);
    return block;
  }

 private:
  // Sets the nearest centre of every voxel in the band.
  bool Mark(BandBlock& block) const {
    const std::array<int, 3> index = UnpackBlock(block.key);
    const auto reach = static_cast<float>(ReachVoxels(settings_));
    const int blocks_around = static_cast<int>(std::ceil(reach / kBlockSize));
    BandMarks marks;
    for (int x = index[0] - blocks_around; x <= index[0] + blocks_around; ++x) {
      for (int y = index[1] - blocks_around; y <= index[1] + blocks_around; ++y) {
        const BlockKey last = PackBlock(x, y, index[2] + blocks_around);
        auto run = std::lower_bound(
            runs_.begin(), runs_.end(),
            std::pair(PackBlock(x, y, index[2] - blocks_around), std::int32_t{-1}));
        for (; run != runs_.end() && run->first <= last; ++run) {
          MarkAround(run->second, index, marks, block);
        }
      }
    }
    bool any = false;
    for (std::size_t i = 0; i < kVoxelsPerBlock; ++i) {
      if (block.voxels[i].center < 0) continue;
      if (marks.IsBeyondRim(i, reach)) {
        block.voxels[i].center = -1;
      } else {
        any = true;
      }
    }
    return any;
  }

  void MarkAround(std::int32_t center, const std::array<int, 3>& index, BandMarks& marks,
                  BandBlock& block) const {
    const Center& at = centers_[static_cast<std::size_t>(center)];
    const Eigen::Vector3d first = Eigen::Vector3d(index[0], index[1], index[2]) * kBlockSize;
    const Eigen::Vector3f local =
        (at.position.cast<double>() / settings_.voxel_m - first).cast<float>();
    const auto reach = static_cast<float>(ReachVoxels(settings_));
    std::array<int, 3> low{};
    std::array<int, 3> high{};
    for (std::size_t a = 0; a < 3; ++a) {
      const float p = local[static_cast<int>(a)];
      low[a] = std::max(0, static_cast<int>(std::ceil(p - reach)));
      high[a] = std::min(kBlockSize - 1, static_cast<int>(std::floor(p + reach)));
    }
    for (int z = low[2]; z <= high[2]; ++z) {
      for (int y = low[1]; y <= high[1]; ++y) {
        for (int x = low[0]; x <= high[0]; ++x) {
          const VoxelPlace place(Eigen::Vector3i(x, y, z).cast<float>() - local, at.normal);
          if (!IsInBand(place, reach)) continue;
          const auto i = static_cast<std::size_t>((z * kBlockSize + y) * kBlockSize + x);
          marks.Add(i, place, reach);
          if (!(place.distance2 < marks.nearest[i])) continue;
          marks.nearest[i] = place.distance2;
          block.voxels[i].center = center;
        }
      }
    }
  }

  void Evaluate(BandBlock& block) const {
    const std::array<int, 3> index = UnpackBlock(block.key);
    const Eigen::Vector3d first = Eigen::Vector3d(index[0], index[1], index[2]) * kBlockSize;
    const auto at = [&](int x, int y, int z) {
      return Eigen::Vector3f(
          ((first + Eigen::Vector3d(x, y, z)) * settings_.voxel_m).cast<float>());
    };
    const Eigen::AlignedBox3f box(at(0, 0, 0), at(kBlockSize - 1, kBlockSize - 1, kBlockSize - 1));
    const std::vector<int> touching = cells_.Touching(box);
    for (int i = 0; i < kVoxelsPerBlock; ++i) {
      BandVoxel& voxel = block.voxels[static_cast<std::size_t>(i)];
      if (voxel.center < 0) continue;
      const auto value = cells_.At(
          at(i % kBlockSize, i / kBlockSize % kBlockSize, i / (kBlockSize * kBlockSize)), touching);
      const float slope = value ? value->gradient.norm() : 0.0F;
      constexpr float kMinSlope = 1e-3F;
      if (!(slope > kMinSlope)) {
        voxel.center = -1;
        continue;
      }
      voxel.distance = value->value / slope;
      for (int axis = 0; axis < 3; ++axis) {
        voxel.gradient[static_cast<std::size_t>(axis)] =
            static_cast<std::int16_t>(std::lround(value->gradient[axis] / slope * kBandScale));
      }
    }
  }

  const std::vector<Center>& centers_;
  const CenterRuns& runs_;
  const CellTree& cells_;
  BandSettings settings_;
};

}  // namespace

std::vector<BlockKey> BandBlocks(const std::vector<Center>& centers, const BandSettings& settings) {
  const double reach = ReachVoxels(settings);
  std::vector<BlockKey> keys;
  for (const Center& center : centers) {
    const Eigen::Vector3d at = center.position.cast<double>() / settings.voxel_m;
    std::array<int, 3> low{};
    std::array<int, 3> high{};
    for (std::size_t a = 0; a < 3; ++a) {
      const double p = at[static_cast<int>(a)];
      low[a] = FloorDivide(static_cast<int>(std::ceil(p - reach)), kBlockSize);
      high[a] = FloorDivide(static_cast<int>(std::floor(p + reach)), kBlockSize);
    }
    for (int x = low[0]; x <= high[0]; ++x) {
      for (int y = low[1]; y <= high[1]; ++y) {
        for (int z = low[2]; z <= high[2]; ++z) keys.push_back(PackBlock(x, y, z));
      }
    }
  }
  tbb::parallel_sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  return keys;
}

std::vector<BandBlock> EvaluateBand(const std::vector<Center>& centers, const CellTree& cells,
                                    const std::vector<BlockKey>& blocks,
                                    const BandSettings& settings) {
  const CenterRuns runs = SortCenters(centers, settings);
  const BlockMaker maker(centers, runs, cells, settings);
  std::vector<BandBlock> made(blocks.size());
  ParallelFor(static_cast<int>(blocks.size()), 8, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      made[i] = maker.Make(blocks[i]);
    }
  });
  made.erase(std::remove_if(made.begin(), made.end(),
                            [](const BandBlock& block) { return block.voxels.empty(); }),
             made.end());
  return made;
}

}  // namespace fringe_fusion::internal
