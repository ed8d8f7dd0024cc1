#include "fringe_fusion/fusion/implicit_model.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>
#include <utility>

#include "block_field.hpp"
#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion {

using internal::BlockField;
using internal::BlockKey;
using internal::ViewSamples;
using internal::Voxel;

namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr double kBytesPerGb = 1e9;
constexpr std::size_t kBytesPerBlock = sizeof(BlockField) + 64;  // with its map entry

FieldSample Unsupported() {
  FieldSample sample;
  sample.distance = sample.sigma = sample.weight = kNan;
  sample.gradient.setConstant(kNan);
  return sample;
}

struct RebuiltBlock {
  BlockKey key = 0;
  std::unique_ptr<BlockField> field;  // nullptr: no sample reaches the block any more
};

}  // namespace

struct ImplicitModel::Impl {
  FusionConfig config;
  std::map<int, ViewSamples> views;
  std::unordered_map<BlockKey, std::unique_ptr<BlockField>> blocks;  // looked up, never iterated in
  std::vector<BlockKey> keys;                                        // order; keys is ascending
  float min_weight = 0.0F;

  [[nodiscard]] const BlockField* Find(BlockKey key) const {
    const auto found = blocks.find(key);
    return found == blocks.end() ? nullptr : found->second.get();
  }
  [[nodiscard]] bool Supported(const Voxel& voxel) const {
    return voxel.weight > 0.0F && voxel.weight >= min_weight;
  }
  // The voxel, or nullptr where nothing was measured.
  [[nodiscard]] const Voxel* At(const std::array<int, 3>& voxel) const {
    const BlockField* field = Find(internal::BlockOfVoxel(voxel));
    if (field == nullptr) return nullptr;
    const Voxel& found = (*field)[static_cast<std::size_t>(internal::IndexInBlock(voxel))];
    return Supported(found) ? &found : nullptr;
  }

  [[nodiscard]] std::size_t SampleBytes() const {
    std::size_t bytes = 0;
    for (const auto& [id, view] : views) bytes += view.MemoryBytes();
    return bytes;
  }

  [[nodiscard]] Status CheckMemory(std::size_t num_touched, std::size_t new_sample_bytes) const;
  [[nodiscard]] Result<std::vector<RebuiltBlock>> Rebuild(
      const std::vector<BlockKey>& touched, const std::vector<const ViewSamples*>& sources,
      const Progress& progress) const;
  void Commit(std::vector<RebuiltBlock> rebuilt);
  void UpdateMinWeight();
};

// Old and new fields of the touched blocks exist side by side until the new ones are complete.
Status ImplicitModel::Impl::CheckMemory(std::size_t num_touched,
                                        std::size_t new_sample_bytes) const {
  const double needed = static_cast<double>((blocks.size() + num_touched) * kBytesPerBlock +
                                            SampleBytes() + new_sample_bytes) /
                        kBytesPerGb;
  if (needed <= config.max_memory_gb) return {};
  // The number of blocks of a surface grows with the inverse square of the voxel size.
  const double proposal = config.voxel_m * std::sqrt(needed / config.max_memory_gb) * 1.1;
  return Fail(
      "fusion: voxel_m = {} needs {:.2f} GB ({} blocks touched), limit max_memory_gb = {}; "
      "use voxel_m >= {:.3g}",
      config.voxel_m, needed, num_touched, config.max_memory_gb, proposal);
}

Result<std::vector<RebuiltBlock>> ImplicitModel::Impl::Rebuild(
    const std::vector<BlockKey>& touched, const std::vector<const ViewSamples*>& sources,
    const Progress& progress) const {
  const internal::FieldSettings settings{config.voxel_m, config.order, config.kernel_radius_voxels,
                                         config.max_centroid_offset_voxels};
  std::vector<RebuiltBlock> rebuilt(touched.size());
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

void ImplicitModel::Impl::Commit(std::vector<RebuiltBlock> rebuilt) {
  for (RebuiltBlock& block : rebuilt) {
    if (block.field == nullptr) {
      blocks.erase(block.key);
    } else {
      blocks[block.key] = std::move(block.field);
    }
  }
  keys.clear();
  for (const auto& [key, field] : blocks) keys.push_back(key);
  std::sort(keys.begin(), keys.end());
  UpdateMinWeight();
}

void ImplicitModel::Impl::UpdateMinWeight() {
  std::vector<float> weights;
  for (const BlockKey key : keys) {
    for (const Voxel& voxel : *Find(key)) {
      const bool near_surface = std::abs(voxel.distance) < 1.0F;
      if (voxel.weight > 0.0F && near_surface) weights.push_back(voxel.weight);
    }
  }
  min_weight = 0.0F;
  if (weights.empty()) return;
  const auto middle = weights.begin() + static_cast<std::ptrdiff_t>(weights.size() / 2);
  std::nth_element(weights.begin(), middle, weights.end());
  min_weight = static_cast<float>(config.min_weight_ratio) * *middle;
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
  std::vector<BlockKey> touched;
  std::size_t new_bytes = 0;
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
    const std::vector<BlockKey> of_view = internal::TouchedBlocks(*samples);
    touched.insert(touched.end(), of_view.begin(), of_view.end());
    new_bytes += samples->MemoryBytes();
    added.emplace(view.id, std::move(*samples));
  }
  std::sort(touched.begin(), touched.end());
  touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
  if (Status status = impl_->CheckMemory(touched.size(), new_bytes); !status) return status;

  std::map<int, const ViewSamples*> sources;
  for (const auto& [id, view] : impl_->views) sources[id] = &view;
  for (const auto& [id, view] : added) sources[id] = &view;
  std::vector<const ViewSamples*> in_id_order;
  for (const auto& [id, view] : sources) in_id_order.push_back(view);
  Result<std::vector<RebuiltBlock>> rebuilt = impl_->Rebuild(touched, in_id_order, progress);
  if (!rebuilt) return Forward(rebuilt);
  impl_->views.merge(added);
  impl_->Commit(std::move(*rebuilt));
  return {};
}

Status ImplicitModel::RemoveView(int view_id) {
  const auto found = impl_->views.find(view_id);
  if (found == impl_->views.end()) return Fail("view {}: not in the model", view_id);
  const std::vector<BlockKey> touched = internal::TouchedBlocks(found->second);
  std::vector<const ViewSamples*> remaining;
  for (const auto& [id, view] : impl_->views) {
    if (id != view_id) remaining.push_back(&view);
  }
  Result<std::vector<RebuiltBlock>> rebuilt = impl_->Rebuild(touched, remaining, NoProgress);
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

const FusionConfig& ImplicitModel::config() const { return impl_->config; }
std::size_t ImplicitModel::NumBlocks() const { return impl_->blocks.size(); }

std::size_t ImplicitModel::MemoryBytes() const {
  return impl_->blocks.size() * kBytesPerBlock + impl_->SampleBytes();
}

std::vector<ImplicitModel::BlockIndex> ImplicitModel::Blocks() const {
  std::vector<BlockIndex> indices;
  indices.reserve(impl_->keys.size());
  for (const BlockKey key : impl_->keys) indices.push_back(internal::UnpackBlock(key));
  return indices;
}

FieldSample ImplicitModel::AtVoxel(const std::array<int, 3>& voxel) const {
  const bool in_range = std::all_of(voxel.begin(), voxel.end(), [](int value) {
    return std::abs(static_cast<long>(value)) < internal::kMaxVoxelCoordinate;
  });
  const Voxel* found = in_range ? impl_->At(voxel) : nullptr;
  if (found == nullptr) return Unsupported();
  FieldSample sample;
  sample.supported = true;
  sample.distance = found->distance * static_cast<float>(impl_->config.voxel_m);
  for (int axis = 0; axis < 3; ++axis) {
    sample.gradient[axis] = static_cast<float>(found->gradient[static_cast<std::size_t>(axis)]) /
                            internal::kGradientScale;
  }
  sample.sigma = found->sigma;
  sample.weight = found->weight;
  sample.num_views = found->num_views;
  sample.color = found->color;
  return sample;
}

FieldSample ImplicitModel::Query(const Eigen::Vector3d& point_object) const {
  const Eigen::Vector3d position = point_object / impl_->config.voxel_m;
  if (!(position.cwiseAbs().maxCoeff() < internal::kMaxVoxelCoordinate - 1)) return Unsupported();
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
    if (!at.supported) return Unsupported();
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
  PaddedDistances distances;
  distances.fill(kNan);
  const auto voxel_m = static_cast<float>(impl_->config.voxel_m);
  for (int neighbor = 0; neighbor < 8; ++neighbor) {
    const std::array<int, 3> step{neighbor & 1, (neighbor >> 1) & 1, neighbor >> 2};
    const BlockField* field = impl_->Find(
        internal::PackBlock(block[0] + step[0], block[1] + step[1], block[2] + step[2]));
    if (field == nullptr) continue;
    const auto end = [&](std::size_t axis) { return step[axis] == 1 ? 1 : kBlockSize; };
    for (int z = 0; z < end(2); ++z) {
      for (int y = 0; y < end(1); ++y) {
        for (int x = 0; x < end(0); ++x) {
          const Voxel& voxel =
              (*field)[static_cast<std::size_t>((z * kBlockSize + y) * kBlockSize + x)];
          if (!impl_->Supported(voxel)) continue;
          const int to =
              ((z + step[2] * kBlockSize) * kPaddedSize + y + step[1] * kBlockSize) * kPaddedSize +
              x + step[0] * kBlockSize;
          distances[static_cast<std::size_t>(to)] = voxel.distance * voxel_m;
        }
      }
    }
  }
  return distances;
}

}  // namespace fringe_fusion
