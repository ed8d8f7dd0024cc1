#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "fringe_fusion/common/image.hpp"

namespace fringe_fusion {

/// The field at one point.
struct FieldSample {
  bool supported = false;  ///< false: nothing was measured near the point; the rest is NaN
  float distance = 0.0F;   ///< signed, positive outside [m]
  /// Weighted mean of the samples' normals: the gradient of the distance near the surface.
  Eigen::Vector3f gradient = Eigen::Vector3f::Zero();
  float sigma = 0.0F;   ///< standard deviation of the distance [m]
  float weight = 0.0F;  ///< sum of w [1/m^2]
  int num_views = 0;
  Rgb8 color;
};

/// A signed distance on sparse blocks of 8 x 8 x 8 voxels in the object frame: what surface
/// extraction reads, whichever method made it. Voxel (i, j, k) lies at voxel_m * (i, j, k).
class VoxelField {
 public:
  using BlockIndex = std::array<int, 3>;
  static constexpr int kBlockSize = 8;
  static constexpr int kPaddedSize = kBlockSize + 1;
  using PaddedDistances = std::array<float, kPaddedSize * kPaddedSize * kPaddedSize>;

  virtual ~VoxelField() = default;

  [[nodiscard]] virtual double voxel_m() const = 0;
  [[nodiscard]] virtual std::size_t NumBlocks() const = 0;
  /// Allocated blocks in lexicographic order.
  [[nodiscard]] virtual std::vector<BlockIndex> Blocks() const = 0;
  /// Field at a voxel; not supported where nothing was measured.
  [[nodiscard]] virtual FieldSample AtVoxel(const std::array<int, 3>& voxel) const = 0;
  /// Distances [m] at the voxels of a block and one layer beyond on the high sides, x fastest; NaN
  /// where not supported.
  [[nodiscard]] virtual PaddedDistances DistancesOf(const BlockIndex& block) const = 0;
  /// The field at any point of the object frame.
  [[nodiscard]] virtual FieldSample Query(const Eigen::Vector3d& point_object) const = 0;

 protected:
  VoxelField() = default;
  VoxelField(const VoxelField&) = default;
  VoxelField& operator=(const VoxelField&) = default;
  VoxelField(VoxelField&&) = default;
  VoxelField& operator=(VoxelField&&) = default;
};

}  // namespace fringe_fusion
