#pragma once

#include <Eigen/Core>
#include <array>
#include <limits>
#include <memory>

#include "block_key.hpp"
#include "sum_lines.hpp"
#include "view_samples.hpp"

namespace fringe_fusion::internal {

/// One value for each voxel of a block, x fastest.
using Channel = Eigen::Array<float, kVoxelsPerBlock, 1>;
/// The additive sums on one block, in voxels.
struct KernelSums {
  Channel weight = Channel::Zero();          ///< W  = sum w
  std::array<Channel, 3> offset;             ///< S1 = sum w p'
  std::array<Channel, 3> normal;             ///< S2 = sum w n
  Channel offset_normal = Channel::Zero();   ///< S3 = sum w p'.n
  Channel offset_squared = Channel::Zero();  ///< S4 = sum w |p'|^2
  Channel variance = Channel::Zero();        ///< sum w^2 sigma^2 [1/m^2], w in 1/m^2
  std::array<Channel, 3> color;              ///< sum w c

  KernelSums() {
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<std::size_t>(axis);
      offset[a].setZero();
      normal[a].setZero();
      color[a].setZero();
    }
  }
};

/// Which sheet a voxel belongs to.
struct SheetNormals {
  std::array<Channel, 3> sum;        ///< sum of k^4 n: the nearest sheet outweighs the others
  Channel weight = Channel::Zero();  ///< sum of k^4
  Channel nearest2 = Channel::Constant(std::numeric_limits<float>::infinity());
  std::array<Channel, 3> nearest;  ///< normal of the nearest sample

  SheetNormals() {
    for (auto& channel : sum) channel.setZero();
    for (auto& channel : nearest) channel.setZero();
  }

  /// Unit normal of each voxel's sheet: the mean where it is clear, else (half way between two
  /// sheets) that of the nearest sample. Zero where no sample reaches.
  [[nodiscard]] std::array<Channel, 3> Consensus() const;
};

constexpr LineMask kAllLines = ~LineMask{0};

/// Adds a sample to the sums.
/// @param sample position from the first voxel of the block [voxels].
/// @param sheets unit consensus normal per voxel, or nullptr where all samples agree anyway.
/// @param lines where to add it.
void AddToSums(const Sample& sample, float radius_voxels, const std::array<Channel, 3>* sheets,
               LineMask lines, KernelSums& sums);

void AddToSheets(const Sample& sample, float radius_voxels, SheetNormals& sheets);

}  // namespace fringe_fusion::internal
