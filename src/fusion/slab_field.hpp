#pragma once

#include <map>
#include <memory>
#include <vector>

#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/fusion/implicit_model.hpp"
#include "view_samples.hpp"

namespace fringe_fusion::internal {

/// Block columns in x, both included.
struct SlabRange {
  int first = 0;
  int last = 0;
};

/// Columns beside a slab whose samples its field needs. @param max_radius_voxels of all views.
[[nodiscard]] int SlabMargin(const FusionConfig& config, double max_radius_voxels);

/// The field of a model on the blocks of a slab, the same bytes as in the whole model; it can be
/// read one block beyond the slab, as the extraction does.
class SlabField : public VoxelField {
 public:
  /// @param views all samples of the slab and its margin. @param min_weight of the whole model.
  /// @return error on cancel.
  [[nodiscard]] static Result<SlabField> Make(const FusionConfig& config,
                                              std::map<int, ViewSamples> views,
                                              const SlabRange& range, float min_weight,
                                              const Progress& progress);
  SlabField(SlabField&&) noexcept;
  SlabField& operator=(SlabField&&) noexcept;
  ~SlabField() override;

  [[nodiscard]] double voxel_m() const override;
  [[nodiscard]] std::size_t NumBlocks() const override;
  /// Those of the slab.
  [[nodiscard]] std::vector<BlockIndex> Blocks() const override;
  [[nodiscard]] FieldSample AtVoxel(const std::array<int, 3>& voxel) const override;
  [[nodiscard]] PaddedDistances DistancesOf(const BlockIndex& block) const override;
  /// Not supported anywhere: the extraction reads voxels.
  [[nodiscard]] FieldSample Query(const Eigen::Vector3d& point_object) const override;

 private:
  explicit SlabField(std::unique_ptr<ImplicitModel::Impl> impl, const SlabRange& range);
  std::unique_ptr<ImplicitModel::Impl> impl_;
  SlabRange range_;
};

/// Weights of the voxels near the surface of a slab; their median over all slabs decides what the
/// model supports. @return error on cancel.
[[nodiscard]] Result<std::vector<float>> SlabWeights(const FusionConfig& config,
                                                     std::map<int, ViewSamples> views,
                                                     const SlabRange& range,
                                                     const Progress& progress);

/// Memory of a block of the field while a slab is made and extracted [B].
[[nodiscard]] std::size_t SlabBlockBytes();

}  // namespace fringe_fusion::internal
