#pragma once

#include <cmath>
#include <map>
#include <memory>
#include <unordered_map>
#include <vector>

#include "block_field.hpp"
#include "fringe_fusion/fusion/implicit_model.hpp"
#include "view_samples.hpp"

namespace fringe_fusion {
namespace internal {

constexpr std::size_t kBytesPerBlock = sizeof(BlockField) + 64;  // with its map entry

struct RebuiltBlock {
  BlockKey key = 0;
  std::unique_ptr<BlockField> field;  // nullptr: no sample reaches the block any more
};

/// Weights of the voxels of a block near the surface.
inline void AppendNearWeights(const BlockField& field, std::vector<float>& weights) {
  for (const Voxel& voxel : field.voxels) {
    const bool near_surface = std::abs(voxel.distance) < 1.0F;
    if (voxel.weight > 0.0F && near_surface) weights.push_back(voxel.weight);
  }
}

}  // namespace internal

/// What a model holds; shared by the files that add to it, compare it and store it.
struct ImplicitModel::Impl {
  FusionConfig config;
  std::map<int, internal::ViewSamples> views;
  std::unordered_map<internal::BlockKey, std::unique_ptr<internal::BlockField>>
      blocks;                            // looked up, never iterated in
  std::vector<internal::BlockKey> keys;  // order; keys is ascending
  float min_weight = 0.0F;

  [[nodiscard]] const internal::BlockField* Find(internal::BlockKey key) const {
    const auto found = blocks.find(key);
    return found == blocks.end() ? nullptr : found->second.get();
  }
  [[nodiscard]] bool Supported(const internal::Voxel& voxel) const {
    return voxel.weight > 0.0F && voxel.weight >= min_weight;
  }
  [[nodiscard]] internal::FieldSettings Settings() const {
    return {config.voxel_m, config.order, config.num_levels, config.kernel_radius_voxels,
            config.max_centroid_offset_voxels};
  }

  [[nodiscard]] std::size_t SampleBytes() const {
    std::size_t bytes = 0;
    for (const auto& [id, view] : views) bytes += view.MemoryBytes();
    return bytes;
  }

  [[nodiscard]] Status CheckMemory(std::size_t num_touched, std::size_t new_sample_bytes) const;
  [[nodiscard]] Result<std::vector<internal::RebuiltBlock>> Rebuild(
      const std::vector<internal::BlockKey>& touched,
      const std::vector<const internal::ViewSamples*>& sources, const Progress& progress) const;
  // The blocks whose field changes when these views come or go.
  [[nodiscard]] std::vector<internal::BlockKey> Affected(
      const std::vector<const internal::ViewSamples*>& changed) const;
  void Commit(std::vector<internal::RebuiltBlock> rebuilt);
  void Blend(const std::vector<internal::BlockKey>& changed);
  void UpdateMinWeight();
  [[nodiscard]] FieldSample AtVoxel(const std::array<int, 3>& voxel) const;
  [[nodiscard]] VoxelField::PaddedDistances DistancesOf(const VoxelField::BlockIndex& block) const;
};

}  // namespace fringe_fusion
