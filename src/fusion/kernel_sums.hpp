#pragma once

#include <Eigen/Core>
#include <array>
#include <limits>
#include <memory>

#include "block_key.hpp"
#include "view_samples.hpp"

namespace fringe_fusion::internal {

constexpr float kRadiusInWidths = 2.5F;  ///< R / h: the cut Gaussian has lost 96 % there

/// One value for each voxel of a block, x fastest.
using Channel = Eigen::Array<float, kVoxelsPerBlock, 1>;
/// The voxels of one line of a block in x.
using Line = Eigen::Array<float, kBlockSize, 1>;
using Line3 = std::array<Line, 3>;

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

/// Factors of the kernel of one sample on the lines of a block.
struct SampleKernel {
  SampleKernel(const Sample& placed_sample, float radius_voxels);

  /// Kernel on the line (y, z); zero outside the support.
  [[nodiscard]] Line On(int y, int z) const {
    const float rest = gap_squared[1][y] + gap_squared[2][z];
    const Line taper = (1.0F - (gap_squared[0] + rest) * inverse_radius2).max(0.0F);
    return gauss[0] * (gauss[1][y] * gauss[2][z]) * taper * taper;
  }
  [[nodiscard]] bool Reaches(int y, int z) const {
    return gap_squared[1][y] + gap_squared[2][z] < radius2;
  }

  const Sample& sample;  ///< position from the first voxel of the block [voxels]
  float radius2;
  float inverse_radius2;
  Line3 gap;  ///< p' = p - x per axis
  Line3 gap_squared;
  Line3 gauss;
  std::array<int, 3> first{};  ///< voxels in reach, per axis
  std::array<int, 3> last{};
};

/// The lines (y, z) of a block that are wanted: bit z * 8 + y.
using LineMask = std::uint64_t;
constexpr LineMask kAllLines = ~LineMask{0};

/// Adds a sample to the sums. @param sheets unit consensus normal per voxel, or nullptr where all
/// samples agree anyway. @param lines where to add it.
void AddToSums(const SampleKernel& kernel, const std::array<Channel, 3>* sheets, LineMask lines,
               KernelSums& sums);

void AddToSheets(const SampleKernel& kernel, SheetNormals& sheets);

/// Cosine between sample and sheet from which on a sample counts fully; it counts nothing at 0.
constexpr float kFullAgreementCosine = 0.5F;

}  // namespace fringe_fusion::internal
