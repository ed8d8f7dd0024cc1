#pragma once

#include <array>
#include <cstdint>

#include "fringe_fusion/fusion/implicit_model.hpp"

namespace fringe_fusion::internal {

constexpr int kBlockSize = ImplicitModel::kBlockSize;
constexpr int kVoxelsPerBlock = kBlockSize * kBlockSize * kBlockSize;

// A block coordinate takes 17 bits of a key, offset so that it is never negative. A margin of a few
// blocks keeps the neighbours of an occupied block representable.
constexpr int kBlockCoordinateBits = 17;
constexpr int kBlockCoordinateBias = 1 << (kBlockCoordinateBits - 1);
constexpr int kMaxVoxelCoordinate = kBlockSize * (kBlockCoordinateBias - 8);

/// Numeric order of keys is the lexicographic order of block indices.
using BlockKey = std::uint64_t;

inline BlockKey PackBlock(int x, int y, int z) {
  const auto part = [](int value) { return static_cast<BlockKey>(value + kBlockCoordinateBias); };
  return (part(x) << (2 * kBlockCoordinateBits)) | (part(y) << kBlockCoordinateBits) | part(z);
}

inline std::array<int, 3> UnpackBlock(BlockKey key) {
  constexpr BlockKey kMask = (BlockKey{1} << kBlockCoordinateBits) - 1;
  const auto part = [&](int shift) {
    return static_cast<int>((key >> shift) & kMask) - kBlockCoordinateBias;
  };
  return {part(2 * kBlockCoordinateBits), part(kBlockCoordinateBits), part(0)};
}

/// Rounds towards minus infinity, so that blocks tile negative coordinates as well.
inline int FloorDivide(int value, int divisor) {
  return value >= 0 ? value / divisor : -((divisor - 1 - value) / divisor);
}

inline BlockKey BlockOfVoxel(const std::array<int, 3>& voxel) {
  return PackBlock(FloorDivide(voxel[0], kBlockSize), FloorDivide(voxel[1], kBlockSize),
                   FloorDivide(voxel[2], kBlockSize));
}

/// Index of a voxel within its block, x fastest.
inline int IndexInBlock(const std::array<int, 3>& voxel) {
  const auto part = [](int value) { return value & (kBlockSize - 1); };
  return (part(voxel[2]) * kBlockSize + part(voxel[1])) * kBlockSize + part(voxel[0]);
}

}  // namespace fringe_fusion::internal
