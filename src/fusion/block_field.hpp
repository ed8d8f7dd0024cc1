#pragma once

#include <array>
#include <memory>
#include <vector>

#include "block_key.hpp"
#include "view_samples.hpp"

namespace fringe_fusion::internal {

/// What the sums say at one voxel. weight = 0: not supported.
struct Voxel {
  float distance = 0.0F;                   ///< of level 0 [voxels]
  float noise = 0.0F;                      ///< its sigma by the points' own noise [voxels]
  float shared = 0.0F;                     ///< its sigma by what whole views share [voxels]
  float weight = 0.0F;                     ///< [1/m^2]
  std::array<std::int16_t, 3> gradient{};  ///< in units of 1 / kGradientScale
  Rgb8 color;
  std::uint8_t num_views = 0;
  /// Levels 1, 2: distance less that of level 0, in units of 1 / kDeltaScale voxels, and noise over
  /// that of level 0, in units of 1 / kRatioScale. Ratio 0: the level has nothing better to say.
  std::array<std::int16_t, kMaxLevels - 1> delta{};
  std::array<std::uint16_t, kMaxLevels - 1> noise_ratio{};
};
constexpr float kGradientScale = 32767.0F;
constexpr float kDeltaScale = 8192.0F;
constexpr float kRatioScale = 65535.0F;

/// How far a level and the next wider one differ, against what their noise explains: sums over the
/// voxels of a cell near the surface [voxels^2].
struct LevelCell {
  float difference2 = 0.0F;
  float variance = 0.0F;
};
constexpr int kLevelCellVoxels = 2;
constexpr int kLevelCellsPerSide = kBlockSize / kLevelCellVoxels;
constexpr int kLevelCells = kLevelCellsPerSide * kLevelCellsPerSide * kLevelCellsPerSide;

struct BlockField {
  std::array<Voxel, kVoxelsPerBlock> voxels;
  std::array<std::array<LevelCell, kLevelCells>, kMaxLevels - 1> cells;
  // The final field, from this block and its neighbours (level_blend.hpp).
  std::array<float, kVoxelsPerBlock> distance{};  ///< [voxels]
  std::array<float, kVoxelsPerBlock> sigma{};     ///< [m]
};

struct FieldSettings {
  double voxel_m = 0.0;
  int order = 0;
  int num_levels = 1;
  double kernel_radius_voxels = 0.0;
  double max_centroid_offset_voxels = 0.0;
};

/// The sums of one block at all levels, as a pure function of the samples of all views, added in
/// the order given: w, w p', w n, w p'.n, w |p'|^2, w^2 sigma^2 and colour, with p' = p - x and the
/// kernel
///   k = exp(-|p'|^2 / 2 h^2) (1 - |p'|^2 / R^2)^2,   h = R / 2.5,   R = 2^level R_0.
/// Levels 1 and above are evaluated near the surface of level 0 only.
///
/// Sheets that face away from each other (both sides of a thin rib) must not be averaged: where the
/// normals within reach of the block differ by more than 60 deg, a first pass finds at each voxel
/// the normal of the sheet nearest to it, and the sums take a sample in the measure in which its
/// normal agrees with that one (fully within 60 deg, not at all beyond 90 deg).
/// @param views in ascending id.
/// @return nullptr when no sample reaches the block.
/// Ref: order 2: Guennebaud and Gross, Algebraic Point Set Surfaces, 2007.
[[nodiscard]] std::unique_ptr<BlockField> MakeBlockField(
    BlockKey block, const std::vector<const ViewSamples*>& views, const FieldSettings& settings);

}  // namespace fringe_fusion::internal
