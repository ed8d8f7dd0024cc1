#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <vector>

#include "fringe_fusion/fusion/voxel_field.hpp"
#include "fringe_fusion/pose/view.hpp"

namespace fringe_fusion::internal {

/// A dense grid of nodes, x fastest. Node (i, j, k) lies at origin + step (i, j, k).
struct SpaceGrid {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< [m]
  double step = 0.0;                                 ///< [m]
  std::array<int, 3> size{};

  [[nodiscard]] std::size_t count() const {
    return static_cast<std::size_t>(size[0]) * static_cast<std::size_t>(size[1]) *
           static_cast<std::size_t>(size[2]);
  }
  [[nodiscard]] std::size_t Index(int x, int y, int z) const {
    return (static_cast<std::size_t>(z) * static_cast<std::size_t>(size[1]) +
            static_cast<std::size_t>(y)) *
               static_cast<std::size_t>(size[0]) +
           static_cast<std::size_t>(x);
  }
  [[nodiscard]] Eigen::Vector3d At(int x, int y, int z) const {
    return origin + step * Eigen::Vector3d(x, y, z);
  }
};

enum class Space : std::uint8_t { kUnknown, kEmpty, kSeen };

/// Marks the nodes whose cell a line of sight of a camera or projector passed, up to a clearance
/// before the measured point.
/// @param states one per node; nodes that are kUnknown become kEmpty.
void CarveEmpty(const SpaceGrid& grid, const std::vector<const View*>& views, double clearance_m,
                std::vector<Space>& states);

/// Distance of each empty node from the nearest node that is not empty, in steps, at most `limit`;
/// 0 for the others. Along the axes and diagonals of the grid, never more than the true one.
[[nodiscard]] std::vector<float> DepthOfEmpty(const SpaceGrid& grid,
                                              const std::vector<Space>& states, int limit);

}  // namespace fringe_fusion::internal
