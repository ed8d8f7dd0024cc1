#include "level_blend.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

namespace fringe_fusion::internal {
namespace {

// Cells of the block with a margin for smoothing (2) and for interpolation between cells (1).
constexpr int kMargin = 3;
constexpr int kSide = kLevelCellsPerSide + 2 * kMargin;
constexpr int kPadded = kSide * kSide * kSide;
using PaddedCells = std::array<LevelCell, kPadded>;

// Difference and variance of difference of two levels at a voxel [voxels]; 0 is level 0.
struct LevelValue {
  float delta = 0.0F;
  float noise = 0.0F;
};
LevelValue ValueAt(const Voxel& voxel, int level) {
  if (level == 0) return {0.0F, voxel.noise};
  const auto l = static_cast<std::size_t>(level - 1);
  return {static_cast<float>(voxel.delta[l]) / kDeltaScale,
          static_cast<float>(voxel.noise_ratio[l]) / kRatioScale * voxel.noise};
}

// The samples of the narrow kernel are among those of the wide one, which is nearly the best mean
// of all of them: then Var[D_fine - D_wide] = Var[D_fine] - Var[D_wide].
float DifferenceVariance(const LevelValue& fine, const LevelValue& wide) {
  constexpr float kMinShare = 0.25F;
  const float fine2 = fine.noise * fine.noise;
  return std::max(fine2 - wide.noise * wide.noise, kMinShare * fine2);
}

bool HasLevel(const Voxel& voxel, int level) {
  return level == 0 || voxel.noise_ratio[static_cast<std::size_t>(level - 1)] > 0;
}

PaddedCells Gather(const Neighborhood& blocks, std::size_t pair) {
  PaddedCells padded{};
  for (int z = 0; z < kSide; ++z) {
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const auto part = [](int i) {
          return (i - kMargin + kLevelCellsPerSide) / kLevelCellsPerSide;
        };
        const auto local = [](int i) {
          return (i - kMargin + kLevelCellsPerSide) % kLevelCellsPerSide;
        };
        const BlockField* block =
            blocks[static_cast<std::size_t>((part(z) * 3 + part(y)) * 3 + part(x))];
        if (block == nullptr) continue;
        const int cell = (local(z) * kLevelCellsPerSide + local(y)) * kLevelCellsPerSide + local(x);
        padded[static_cast<std::size_t>((z * kSide + y) * kSide + x)] =
            block->cells[pair][static_cast<std::size_t>(cell)];
      }
    }
  }
  return padded;
}

// Binomial mean over five cells along one axis; cells within two of the rim are left as they are.
PaddedCells SmoothAxis(const PaddedCells& cells, int step) {
  constexpr std::array<float, 5> kTaps{1.0F, 4.0F, 6.0F, 4.0F, 1.0F};
  PaddedCells smooth{};
  for (int i = 0; i < kPadded; ++i) {
    const int along = i / step % kSide;
    if (along < 2 || along >= kSide - 2) continue;
    LevelCell sum;
    for (int tap = -2; tap <= 2; ++tap) {
      const LevelCell& from = cells[static_cast<std::size_t>(i + tap * step)];
      const float share = kTaps[static_cast<std::size_t>(tap + 2)];
      sum.difference2 += share * from.difference2;
      sum.variance += share * from.variance;
    }
    smooth[static_cast<std::size_t>(i)] = sum;
  }
  return smooth;
}

// Linear between the middles of the cells.
LevelCell CellAt(const PaddedCells& cells, int voxel) {
  std::array<int, 3> base{};
  std::array<float, 3> t{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int local = voxel & (kBlockSize - 1);
    voxel /= kBlockSize;
    const float at = (static_cast<float>(local) + 0.5F) / kLevelCellVoxels - 0.5F + kMargin;
    base[axis] = static_cast<int>(at);
    t[axis] = at - static_cast<float>(base[axis]);
  }
  LevelCell mean;
  for (int corner = 0; corner < 8; ++corner) {
    float share = 1.0F;
    int index = 0;
    for (int axis = 2; axis >= 0; --axis) {
      const auto a = static_cast<std::size_t>(axis);
      const int step = (corner >> axis) & 1;
      share *= step == 1 ? t[a] : 1.0F - t[a];
      index = index * kSide + base[a] + step;
    }
    const LevelCell& cell = cells[static_cast<std::size_t>(index)];
    mean.difference2 += share * cell.difference2;
    mean.variance += share * cell.variance;
  }
  return mean;
}

// Squared bias of the wider level over the variance of the difference.
float BiasRatio(const LevelCell& cell) {
  // The mean of a few independent squares scatters: half of its expectation is allowed for that.
  constexpr float kAllowance = 1.5F;
  if (!(cell.variance > 0.0F)) return 0.0F;
  return std::max(0.0F, cell.difference2 / cell.variance - kAllowance);
}

struct Blend {
  float delta = 0.0F;
  float variance = 0.0F;
};

// From the widest level inwards: the finer level with its share, the rest what is wider.
Blend BlendVoxel(const Voxel& voxel, const std::array<float, kMaxLevels - 1>& bias_ratios,
                 int num_levels) {
  int level = num_levels - 1;
  while (level > 0 && !HasLevel(voxel, level)) --level;
  const LevelValue widest = ValueAt(voxel, level);
  Blend blend{widest.delta, widest.noise * widest.noise};
  for (--level; level >= 0; --level) {
    if (!HasLevel(voxel, level)) continue;
    const LevelValue fine = ValueAt(voxel, level);
    const float ratio = bias_ratios[static_cast<std::size_t>(level)];
    const float share = ratio / (1.0F + ratio);
    const float fine2 = fine.noise * fine.noise;
    const float bias2 = ratio * std::max(fine2 - blend.variance, 0.0F);
    blend.delta = share * fine.delta + (1.0F - share) * blend.delta;
    blend.variance = share * share * fine2 + (1.0F - share * share) * blend.variance +
                     (1.0F - share) * (1.0F - share) * bias2;
    // How much the finest level itself bends, no finer one shows. Beside an edge the bias grows
    // with the width: it is then as large as the difference to the next level.
    if (level == 0) blend.variance += share * bias2;
  }
  return blend;
}

}  // namespace

void CompareLevels(int num_levels, BlockField& field) {
  constexpr float kBandVoxels = 2.0F;
  for (int i = 0; i < kVoxelsPerBlock; ++i) {
    const Voxel& voxel = field.voxels[static_cast<std::size_t>(i)];
    const float inside = 1.0F - std::abs(voxel.distance) / kBandVoxels;
    if (!(voxel.weight > 0.0F) || !(inside > 0.0F)) continue;
    const auto part = [&](int stride) { return i / stride % kBlockSize / kLevelCellVoxels; };
    const int cell = (part(kBlockSize * kBlockSize) * kLevelCellsPerSide + part(kBlockSize)) *
                         kLevelCellsPerSide +
                     part(1);
    for (int level = 0; level + 1 < num_levels; ++level) {
      if (!HasLevel(voxel, level) || !HasLevel(voxel, level + 1)) continue;
      const LevelValue fine = ValueAt(voxel, level);
      const LevelValue wide = ValueAt(voxel, level + 1);
      const float difference = fine.delta - wide.delta;
      LevelCell& sum = field.cells[static_cast<std::size_t>(level)][static_cast<std::size_t>(cell)];
      sum.difference2 += inside * inside * difference * difference;
      sum.variance += inside * inside * DifferenceVariance(fine, wide);
    }
  }
}

BlendedField BlendLevels(const Neighborhood& blocks, int num_levels, double voxel_m) {
  const BlockField& field = *blocks[13];
  std::array<std::unique_ptr<PaddedCells>, kMaxLevels - 1> cells;
  for (int pair = 0; pair + 1 < num_levels; ++pair) {
    const auto p = static_cast<std::size_t>(pair);
    PaddedCells smooth = Gather(blocks, p);
    for (const int step : {1, kSide, kSide * kSide}) smooth = SmoothAxis(smooth, step);
    cells[p] = std::make_unique<PaddedCells>(smooth);
  }
  BlendedField blended;
  for (int i = 0; i < kVoxelsPerBlock; ++i) {
    const auto index = static_cast<std::size_t>(i);
    const Voxel& voxel = field.voxels[index];
    if (!(voxel.weight > 0.0F)) continue;
    std::array<float, kMaxLevels - 1> bias_ratios{};
    for (std::size_t pair = 0; pair + 1 < static_cast<std::size_t>(num_levels); ++pair) {
      bias_ratios[pair] = BiasRatio(CellAt(*cells[pair], i));
    }
    const Blend blend = BlendVoxel(voxel, bias_ratios, num_levels);
    blended.distance[index] = voxel.distance + blend.delta;
    blended.sigma[index] =
        std::sqrt(blend.variance + voxel.shared * voxel.shared) * static_cast<float>(voxel_m);
  }
  return blended;
}

}  // namespace fringe_fusion::internal
