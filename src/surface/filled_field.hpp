#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "space_grid.hpp"

namespace fringe_fusion::internal {

/// A measured field, continued over all of space by values on a coarser grid: every voxel has a
/// sign, so that the surface closes.
class FilledField : public VoxelField {
 public:
  /// @param measured borrowed. @param box beyond it all is outside.
  /// @param states, values one per node of the grid; empty nodes are positive.
  FilledField(const VoxelField& measured, const Eigen::AlignedBox3d& box, SpaceGrid grid,
              std::vector<Space> states, std::vector<float> values);

  [[nodiscard]] double voxel_m() const override { return measured_.voxel_m(); }
  [[nodiscard]] std::size_t NumBlocks() const override { return blocks_.size(); }
  [[nodiscard]] std::vector<BlockIndex> Blocks() const override { return blocks_; }
  [[nodiscard]] FieldSample AtVoxel(const std::array<int, 3>& voxel) const override;
  /// Clamped to less than a voxel: only the signs decide which cells are crossed.
  [[nodiscard]] PaddedDistances DistancesOf(const BlockIndex& block) const override;
  [[nodiscard]] FieldSample Query(const Eigen::Vector3d& point_object) const override;

  /// Whether the surface in the cell above a voxel comes from measured distances alone.
  [[nodiscard]] bool IsMeasured(const std::array<int, 3>& cell) const;

 private:
  [[nodiscard]] float FillValue(const Eigen::Vector3d& point) const;
  [[nodiscard]] FieldSample FillSample(const Eigen::Vector3d& point) const;
  void FindBlocks();

  const VoxelField& measured_;
  Eigen::AlignedBox3d box_;
  SpaceGrid grid_;
  std::vector<Space> states_;
  std::vector<float> values_;
  std::vector<BlockIndex> blocks_;
  float limit_;  // of the distances in cells that are crossed [m]
};

}  // namespace fringe_fusion::internal
