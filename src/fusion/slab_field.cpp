#include "slab_field.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "model_impl.hpp"
#include "unsupported.hpp"

namespace fringe_fusion::internal {
namespace {

// The blended field of a block needs its neighbours, and the extraction reads one block beyond.
constexpr int kBlendColumns = 1;
constexpr int kReadColumns = 1;

// The blocks in some columns, computed but not blended.
Result<std::unique_ptr<ImplicitModel::Impl>> MakeBlocks(const FusionConfig& config,
                                                        std::map<int, ViewSamples> views,
                                                        const SlabRange& range,
                                                        std::vector<RebuiltBlock>& rebuilt,
                                                        const Progress& progress) {
  auto impl = std::make_unique<ImplicitModel::Impl>();
  impl->config = config;
  impl->views = std::move(views);
  std::vector<const ViewSamples*> sources;
  for (const auto& [id, view] : impl->views) sources.push_back(&view);
  std::vector<BlockKey> touched = impl->Affected(sources);
  touched.erase(std::remove_if(touched.begin(), touched.end(),
                               [&](BlockKey key) {
                                 const int column = UnpackBlock(key)[0];
                                 return column < range.first || column > range.last;
                               }),
                touched.end());
  auto made = impl->Rebuild(touched, sources, progress);
  if (!made) return Forward(made);
  rebuilt = std::move(*made);
  return impl;
}

}  // namespace

int SlabMargin(const FusionConfig& config, double max_radius_voxels) {
  const double radius = max_radius_voxels * (1 << (config.num_levels - 1));
  const int reach = (static_cast<int>(std::ceil(radius)) - 1) / kBlockSize + 1;
  return reach + kBlendColumns + kReadColumns;
}

std::size_t SlabBlockBytes() {
  // Edges, triangles and vertices of the mesh beside the field.
  constexpr std::size_t kMeshBytesPerBlock = 20000;
  return kBytesPerBlock + kMeshBytesPerBlock;
}

SlabField::SlabField(std::unique_ptr<ImplicitModel::Impl> impl, const SlabRange& range)
    : impl_(std::move(impl)), range_(range) {}
SlabField::SlabField(SlabField&&) noexcept = default;
SlabField& SlabField::operator=(SlabField&&) noexcept = default;
SlabField::~SlabField() = default;

Result<SlabField> SlabField::Make(const FusionConfig& config, std::map<int, ViewSamples> views,
                                  const SlabRange& range, float min_weight,
                                  const Progress& progress) {
  constexpr int kBeside = kBlendColumns + kReadColumns;
  std::vector<RebuiltBlock> rebuilt;
  auto impl = MakeBlocks(config, std::move(views), {range.first - kBeside, range.last + kBeside},
                         rebuilt, progress);
  if (!impl) return Forward(impl);
  (*impl)->Commit(std::move(rebuilt));
  (*impl)->min_weight = min_weight;
  return SlabField(std::move(*impl), range);
}

double SlabField::voxel_m() const { return impl_->config.voxel_m; }
std::size_t SlabField::NumBlocks() const { return Blocks().size(); }

std::vector<VoxelField::BlockIndex> SlabField::Blocks() const {
  std::vector<BlockIndex> blocks;
  for (const BlockKey key : impl_->keys) {
    const BlockIndex block = UnpackBlock(key);
    if (block[0] >= range_.first && block[0] <= range_.last) blocks.push_back(block);
  }
  return blocks;
}

FieldSample SlabField::AtVoxel(const std::array<int, 3>& voxel) const {
  return impl_->AtVoxel(voxel);
}

VoxelField::PaddedDistances SlabField::DistancesOf(const BlockIndex& block) const {
  return impl_->DistancesOf(block);
}

FieldSample SlabField::Query(const Eigen::Vector3d& /*point_object*/) const {
  return Unsupported();
}

Result<std::vector<float>> SlabWeights(const FusionConfig& config, std::map<int, ViewSamples> views,
                                       const SlabRange& range, const Progress& progress) {
  FusionConfig first_level = config;
  first_level.num_levels = 1;
  std::vector<RebuiltBlock> rebuilt;
  const auto impl = MakeBlocks(first_level, std::move(views), range, rebuilt, progress);
  if (!impl) return Forward(impl);
  std::vector<float> weights;
  for (const RebuiltBlock& block : rebuilt) {
    if (block.field != nullptr) AppendNearWeights(*block.field, weights);
  }
  return weights;
}

}  // namespace fringe_fusion::internal
