#include "fringe_fusion/fusion/implicit_model.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "block_field.hpp"
#include "common/constants.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "level_blend.hpp"
#include "model_impl.hpp"
#include "unsupported.hpp"

namespace fringe_fusion {

using internal::BlockField;
using internal::BlockKey;
using internal::ViewSamples;
using internal::Voxel;

// Old and new fields of the touched blocks exist side by side until the new ones are complete.
Status ImplicitModel::Impl::CheckMemory(std::size_t num_touched,
                                        std::size_t new_sample_bytes) const {
  const double needed =
      static_cast<double>((blocks.size() + num_touched) * internal::kBytesPerBlock + SampleBytes() +
                          new_sample_bytes) /
      kBytesPerGb;
  if (needed <= config.max_memory_gb) return {};
  // The number of blocks of a surface grows with the inverse square of the voxel size.
  const double proposal = config.voxel_m * std::sqrt(needed / config.max_memory_gb) * 1.1;
  return Fail(
      "fusion: voxel_m = {} needs {:.2f} GB ({} blocks touched), limit max_memory_gb = {}; "
      "use voxel_m >= {:.3g}",
      config.voxel_m, needed, num_touched, config.max_memory_gb, proposal);
}

Result<std::vector<internal::RebuiltBlock>> ImplicitModel::Impl::Rebuild(
    const std::vector<BlockKey>& touched, const std::vector<const ViewSamples*>& sources,
    const Progress& progress) const {
  const internal::FieldSettings settings = Settings();
  std::vector<internal::RebuiltBlock> rebuilt(touched.size());
  // In batches, so that progress is reported and cancelling answered from the calling thread.
  constexpr int kBatch = 512;
  constexpr int kGrain = 4;
  const auto count = static_cast<int>(touched.size());
  for (int start = 0; start < count; start += kBatch) {
    if (!progress("integrate", static_cast<double>(start) / count)) return Fail("{}", kCancelled);
    ParallelFor(std::min(kBatch, count - start), kGrain, [&](int begin, int end) {
      for (int i = start + begin; i < start + end; ++i) {
        const auto index = static_cast<std::size_t>(i);
        rebuilt[index] = {touched[index],
                          internal::MakeBlockField(touched[index], sources, settings)};
      }
    });
  }
  if (!progress("integrate", 1.0)) return Fail("{}", kCancelled);
  return rebuilt;
}

// Blocks come and go with level 0 alone, but the wider levels of the others see the views as well.
std::vector<BlockKey> ImplicitModel::Impl::Affected(
    const std::vector<const ViewSamples*>& changed) const {
  const auto sort = [](std::vector<BlockKey>& keys_to_sort) {
    std::sort(keys_to_sort.begin(), keys_to_sort.end());
    keys_to_sort.erase(std::unique(keys_to_sort.begin(), keys_to_sort.end()), keys_to_sort.end());
  };
  std::vector<BlockKey> affected;
  for (const ViewSamples* view : changed) {
    const std::vector<BlockKey> of_view = internal::TouchedBlocks(*view, 0);
    affected.insert(affected.end(), of_view.begin(), of_view.end());
  }
  sort(affected);
  if (config.num_levels == 1) return affected;
  std::vector<BlockKey> seen;
  for (const ViewSamples* view : changed) {
    const std::vector<BlockKey> of_view = internal::TouchedBlocks(*view, config.num_levels - 1);
    seen.insert(seen.end(), of_view.begin(), of_view.end());
  }
  sort(seen);
  for (const BlockKey key : seen) {
    if (blocks.count(key) != 0) affected.push_back(key);
  }
  sort(affected);
  return affected;
}

void ImplicitModel::Impl::Blend(const std::vector<BlockKey>& changed) {
  std::vector<BlockKey> affected;
  for (const BlockKey key : changed) {
    const std::array<int, 3> block = internal::UnpackBlock(key);
    for (int i = 0; i < 27; ++i) {
      const BlockKey neighbor =
          internal::PackBlock(block[0] + i % 3 - 1, block[1] + i / 3 % 3 - 1, block[2] + i / 9 - 1);
      if (blocks.count(neighbor) != 0) affected.push_back(neighbor);
    }
  }
  std::sort(affected.begin(), affected.end());
  affected.erase(std::unique(affected.begin(), affected.end()), affected.end());
  constexpr int kGrain = 16;
  ParallelFor(static_cast<int>(affected.size()), kGrain, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      const std::array<int, 3> block = internal::UnpackBlock(affected[i]);
      internal::Neighborhood neighborhood{};
      for (int n = 0; n < 27; ++n) {
        neighborhood[static_cast<std::size_t>(n)] = Find(internal::PackBlock(
            block[0] + n % 3 - 1, block[1] + n / 3 % 3 - 1, block[2] + n / 9 - 1));
      }
      internal::BlendedField blended =
          internal::BlendLevels(neighborhood, config.num_levels, config.voxel_m);
      BlockField& field = *blocks.find(affected[i])->second;
      field.distance = blended.distance;
      field.sigma = blended.sigma;
    }
  });
}

void ImplicitModel::Impl::Commit(std::vector<internal::RebuiltBlock> rebuilt) {
  std::vector<BlockKey> changed;
  for (internal::RebuiltBlock& block : rebuilt) {
    changed.push_back(block.key);
    if (block.field == nullptr) {
      blocks.erase(block.key);
    } else {
      blocks[block.key] = std::move(block.field);
    }
  }
  keys.clear();
  for (const auto& [key, field] : blocks) keys.push_back(key);
  std::sort(keys.begin(), keys.end());
  Blend(changed);
  UpdateMinWeight();
}

void ImplicitModel::Impl::UpdateMinWeight() {
  std::vector<float> weights;
  for (const BlockKey key : keys) internal::AppendNearWeights(*Find(key), weights);
  min_weight = 0.0F;
  if (weights.empty()) return;
  const auto middle = weights.begin() + static_cast<std::ptrdiff_t>(weights.size() / 2);
  std::nth_element(weights.begin(), middle, weights.end());
  min_weight = static_cast<float>(config.min_weight_ratio) * *middle;
}

FieldSample ImplicitModel::Impl::AtVoxel(const std::array<int, 3>& voxel) const {
  const bool in_range = std::all_of(voxel.begin(), voxel.end(), [](int value) {
    return std::abs(static_cast<long>(value)) < internal::kMaxVoxelCoordinate;
  });
  const BlockField* field = in_range ? Find(internal::BlockOfVoxel(voxel)) : nullptr;
  if (field == nullptr) return internal::Unsupported();
  const auto index = static_cast<std::size_t>(internal::IndexInBlock(voxel));
  const Voxel& found = field->voxels[index];
  if (!Supported(found)) return internal::Unsupported();
  FieldSample sample;
  sample.supported = true;
  sample.distance = field->distance[index] * static_cast<float>(config.voxel_m);
  for (int axis = 0; axis < 3; ++axis) {
    sample.gradient[axis] = static_cast<float>(found.gradient[static_cast<std::size_t>(axis)]) /
                            internal::kGradientScale;
  }
  sample.sigma = field->sigma[index];
  sample.weight = found.weight;
  sample.num_views = found.num_views;
  sample.color = found.color;
  return sample;
}

VoxelField::PaddedDistances ImplicitModel::Impl::DistancesOf(
    const VoxelField::BlockIndex& block) const {
  PaddedDistances distances;
  distances.fill(kNan);
  const auto voxel_m = static_cast<float>(config.voxel_m);
  for (int neighbor = 0; neighbor < 8; ++neighbor) {
    const std::array<int, 3> step{neighbor & 1, (neighbor >> 1) & 1, neighbor >> 2};
    const BlockField* field =
        Find(internal::PackBlock(block[0] + step[0], block[1] + step[1], block[2] + step[2]));
    if (field == nullptr) continue;
    const auto end = [&](std::size_t axis) { return step[axis] == 1 ? 1 : kBlockSize; };
    for (int z = 0; z < end(2); ++z) {
      for (int y = 0; y < end(1); ++y) {
        for (int x = 0; x < end(0); ++x) {
          const auto from = static_cast<std::size_t>((z * kBlockSize + y) * kBlockSize + x);
          if (!Supported(field->voxels[from])) continue;
          const int to =
              ((z + step[2] * kBlockSize) * kPaddedSize + y + step[1] * kBlockSize) * kPaddedSize +
              x + step[0] * kBlockSize;
          distances[static_cast<std::size_t>(to)] = field->distance[from] * voxel_m;
        }
      }
    }
  }
  return distances;
}

ImplicitModel::ImplicitModel(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ImplicitModel::ImplicitModel(ImplicitModel&&) noexcept = default;
ImplicitModel& ImplicitModel::operator=(ImplicitModel&&) noexcept = default;
ImplicitModel::~ImplicitModel() = default;

Result<ImplicitModel> ImplicitModel::Create(const FusionConfig& config) {
  if (Status status = CheckBounds(config, "fusion"); !status) return Forward(status);
  if (config.order == 1) return Fail("fusion: order = 1 is not defined; use 0 or 2");
  auto impl = std::make_unique<Impl>();
  impl->config = config;
  return ImplicitModel(std::move(impl));
}

Status ImplicitModel::AddView(const View& view, const Progress& progress) {
  return AddSpan(&view, 1, progress);
}

Status ImplicitModel::AddViews(const std::vector<View>& views, const Progress& progress) {
  return AddSpan(views.data(), views.size(), progress);
}

Status ImplicitModel::AddSpan(const View* views, std::size_t count, const Progress& progress) {
  std::map<int, ViewSamples> added;
  for (std::size_t i = 0; i < count; ++i) {
    const View& view = views[i];
    if (impl_->views.count(view.id) != 0 || added.count(view.id) != 0) {
      return Fail("view {} ({}): a view with this id is in the model already", view.id, view.name);
    }
    if (!progress("prepare views", static_cast<double>(i) / static_cast<double>(count))) {
      return Fail("{}", kCancelled);
    }
    Result<ViewSamples> samples = internal::MakeViewSamples(view, impl_->config);
    if (!samples) return Forward(samples);
    added.emplace(view.id, std::move(*samples));
  }
  return AddSamples(std::move(added), progress);
}

Status ImplicitModel::AddSamples(std::map<int, ViewSamples> added, const Progress& progress) {
  std::map<int, const ViewSamples*> sources;
  std::vector<const ViewSamples*> changed;
  std::size_t new_bytes = 0;
  for (const auto& [id, view] : impl_->views) sources[id] = &view;
  for (const auto& [id, view] : added) {
    sources[id] = &view;
    changed.push_back(&view);
    new_bytes += view.MemoryBytes();
  }
  const std::vector<BlockKey> touched = impl_->Affected(changed);
  if (Status status = impl_->CheckMemory(touched.size(), new_bytes); !status) return status;
  std::vector<const ViewSamples*> in_id_order;
  for (const auto& [id, view] : sources) in_id_order.push_back(view);
  Result<std::vector<internal::RebuiltBlock>> rebuilt =
      impl_->Rebuild(touched, in_id_order, progress);
  if (!rebuilt) return Forward(rebuilt);
  impl_->views.merge(added);
  impl_->Commit(std::move(*rebuilt));
  return {};
}

Result<ImplicitModel> ImplicitModel::FromSamples(const FusionConfig& config,
                                                 std::vector<ViewSamples> views,
                                                 const Progress& progress) {
  Result<ImplicitModel> model = Create(config);
  if (!model) return model;
  std::map<int, ViewSamples> by_id;
  for (ViewSamples& view : views) {
    const int id = view.id;
    if (!by_id.emplace(id, std::move(view)).second) return Fail("view {} is there twice", id);
  }
  if (by_id.empty()) return model;
  if (Status status = model->AddSamples(std::move(by_id), progress); !status) {
    return tl::unexpected(status.error());
  }
  return model;
}

Status ImplicitModel::RemoveView(int view_id) {
  const auto found = impl_->views.find(view_id);
  if (found == impl_->views.end()) return Fail("view {}: not in the model", view_id);
  const std::vector<BlockKey> touched = impl_->Affected({&found->second});
  std::vector<const ViewSamples*> remaining;
  for (const auto& [id, view] : impl_->views) {
    if (id != view_id) remaining.push_back(&view);
  }
  Result<std::vector<internal::RebuiltBlock>> rebuilt =
      impl_->Rebuild(touched, remaining, NoProgress);
  if (!rebuilt) return Forward(rebuilt);
  impl_->views.erase(found);
  impl_->Commit(std::move(*rebuilt));
  return {};
}

std::vector<int> ImplicitModel::ViewIds() const {
  std::vector<int> ids;
  for (const auto& [id, view] : impl_->views) ids.push_back(id);
  return ids;
}

const ImplicitModel::Impl& ImplicitModel::impl() const { return *impl_; }
const FusionConfig& ImplicitModel::config() const { return impl_->config; }
double ImplicitModel::voxel_m() const { return impl_->config.voxel_m; }
std::size_t ImplicitModel::NumBlocks() const { return impl_->blocks.size(); }

std::size_t ImplicitModel::MemoryBytes() const {
  return impl_->blocks.size() * internal::kBytesPerBlock + impl_->SampleBytes();
}

std::vector<ImplicitModel::BlockIndex> ImplicitModel::Blocks() const {
  std::vector<BlockIndex> indices;
  indices.reserve(impl_->keys.size());
  for (const BlockKey key : impl_->keys) indices.push_back(internal::UnpackBlock(key));
  return indices;
}

FieldSample ImplicitModel::AtVoxel(const std::array<int, 3>& voxel) const {
  return impl_->AtVoxel(voxel);
}

FieldSample ImplicitModel::Query(const Eigen::Vector3d& point_object) const {
  const Eigen::Vector3d position = point_object / impl_->config.voxel_m;
  if (!(position.cwiseAbs().maxCoeff() < internal::kMaxVoxelCoordinate - 1))
    return internal::Unsupported();
  const Eigen::Vector3i base = position.array().floor().cast<int>();
  const Eigen::Vector3f t = (position - base.cast<double>()).cast<float>();
  FieldSample mean;
  mean.supported = true;
  Eigen::Vector3f color = Eigen::Vector3f::Zero();
  float nearest_share = -1.0F;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3i step(corner & 1, (corner >> 1) & 1, corner >> 2);
    float share = 1.0F;
    for (int axis = 0; axis < 3; ++axis) share *= step[axis] == 1 ? t[axis] : 1.0F - t[axis];
    const FieldSample at = AtVoxel({base[0] + step[0], base[1] + step[1], base[2] + step[2]});
    // On a grid plane the neighbours beyond it do not count; rounding must not make them count.
    constexpr float kNegligibleShare = 1e-5F;
    if (share < kNegligibleShare) continue;
    if (!at.supported) return internal::Unsupported();
    mean.distance += share * at.distance;
    mean.gradient += share * at.gradient;
    mean.sigma += share * at.sigma;
    mean.weight += share * at.weight;
    color += share * Eigen::Vector3f(at.color.r, at.color.g, at.color.b);
    if (share > nearest_share) {
      nearest_share = share;
      mean.num_views = at.num_views;
    }
  }
  const auto channel = [&](int c) { return static_cast<std::uint8_t>(std::lround(color[c])); };
  mean.color = Rgb8{channel(0), channel(1), channel(2)};
  return mean;
}

ImplicitModel::PaddedDistances ImplicitModel::DistancesOf(const BlockIndex& block) const {
  return impl_->DistancesOf(block);
}

}  // namespace fringe_fusion
