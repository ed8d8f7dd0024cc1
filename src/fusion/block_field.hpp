#pragma once

#include <array>
#include <memory>
#include <vector>

#include "block_key.hpp"
#include "view_samples.hpp"

namespace fringe_fusion::internal {

/// The field at one voxel. weight = 0: not supported.
struct Voxel {
  float distance = 0.0F;                   ///< [voxels]
  float sigma = 0.0F;                      ///< [m]
  float weight = 0.0F;                     ///< [1/m^2]
  std::array<std::int16_t, 3> gradient{};  ///< in units of 1 / kGradientScale
  Rgb8 color;
  std::uint8_t num_views = 0;
};
constexpr float kGradientScale = 32767.0F;

using BlockField = std::array<Voxel, kVoxelsPerBlock>;

struct FieldSettings {
  double voxel_m = 0.0;
  int order = 0;
  double kernel_radius_voxels = 0.0;
  double max_centroid_offset_voxels = 0.0;
};

/// The field of one block as a pure function of the samples of all views, summed in the order
/// given: w, w p', w n, w p'.n, w |p'|^2, w^2 sigma^2 and colour, with p' = p - x and the kernel
///   k = exp(-|p'|^2 / 2 h^2) (1 - |p'|^2 / R^2)^2,   h = R / 2.5.
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
