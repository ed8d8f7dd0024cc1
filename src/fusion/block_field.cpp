#include "block_field.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "kernel_sums.hpp"
#include "level_blend.hpp"
#include "sample_cells.hpp"
#include "surface_fit.hpp"

namespace fringe_fusion::internal {
namespace {

// Samples of one view within reach of a block, placed in the block's frame.
struct PlacedView {
  const ViewSamples* view = nullptr;
  std::vector<Sample> samples;
};

// Squared distance from a point to the box of the block's voxels.
float DistanceToVoxels2(const Eigen::Vector3f& position) {
  constexpr auto kLast = static_cast<float>(kBlockSize - 1);
  const Eigen::Vector3f nearest = position.cwiseMax(0.0F).cwiseMin(kLast);
  return (position - nearest).squaredNorm();
}

PlacedView PlaceSamples(const std::array<int, 3>& block, const ViewSamples& view, int level) {
  PlacedView placed{&view, {}};
  const SampleSet& set = view.levels[static_cast<std::size_t>(level)];
  if (set.runs.empty()) return placed;
  const double radius = view.radius_voxels * (1 << level);
  const int reach = (static_cast<int>(std::ceil(radius)) - 1) / kBlockSize + 1;
  const auto radius2 = static_cast<float>(radius * radius);
  for (int x = block[0] - reach; x <= block[0] + reach; ++x) {
    for (int y = block[1] - reach; y <= block[1] + reach; ++y) {
      const BlockKey first = PackBlock(x, y, block[2] - reach);
      const BlockKey last = PackBlock(x, y, block[2] + reach);
      auto run = std::lower_bound(set.runs.begin(), set.runs.end(), first,
                                  [](const SampleRun& r, BlockKey key) { return r.block < key; });
      for (; run->block <= last; ++run) {
        const std::array<int, 3> from = UnpackBlock(run->block);
        const Eigen::Vector3f shift =
            Eigen::Vector3i(from[0] - block[0], from[1] - block[1], from[2] - block[2])
                .cast<float>() *
            static_cast<float>(kBlockSize);
        for (std::uint32_t i = run->begin; i < (run + 1)->begin; ++i) {
          const Eigen::Vector3f position = set.samples[i].position + shift;
          if (!(DistanceToVoxels2(position) < radius2)) continue;
          placed.samples.push_back(set.samples[i]);
          placed.samples.back().position = position;
        }
      }
    }
  }
  return placed;
}

// True when any two normals differ by at most 60 deg: then the sheet test cannot exclude anything.
bool AllAgree(const std::vector<PlacedView>& views) {
  constexpr float kCos30 = 0.8660254F;
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (const PlacedView& view : views) {
    for (const Sample& sample : view.samples) sum += sample.normal;
  }
  const Eigen::Vector3f mean = sum.normalized();
  for (const PlacedView& view : views) {
    for (const Sample& sample : view.samples) {
      if (!(sample.normal.dot(mean) >= kCos30 * sample.normal.norm())) return false;
    }
  }
  return true;
}

// What the sums do not hold: number of views, the part of the variance that a whole view shares,
// and the widest support, per voxel.
struct ViewShares {
  Channel previous_weight = Channel::Zero();
  Channel shared_variance = Channel::Zero();   // sum over views of (sum w)^2 sigma_pose^2
  Channel widening = Channel::Constant(1.0F);  // support over the configured one
  std::array<std::uint8_t, kVoxelsPerBlock> num_views{};
};

Eigen::Vector3f VectorAt(const std::array<Channel, 3>& channels, int i) {
  return {channels[0][i], channels[1][i], channels[2][i]};
}

double PoseVarianceAt(const ViewSamples& view, const std::array<int, 3>& block, int i,
                      const Eigen::Vector3f& normal, double voxel_m) {
  const Eigen::Vector3i local(i % kBlockSize, (i / kBlockSize) % kBlockSize,
                              i / (kBlockSize * kBlockSize));
  const Eigen::Vector3d point =
      (Eigen::Vector3i(block[0], block[1], block[2]) * kBlockSize + local).cast<double>() * voxel_m;
  return PoseVariance(view.pose_covariance, view.T_camera_object * point,
                      view.T_camera_object.linear() * normal.cast<double>().normalized());
}

void CloseView(const ViewSamples& view, const std::array<int, 3>& block,
               const FieldSettings& settings, const KernelSums& sums, ViewShares& shares) {
  const auto widening = static_cast<float>(view.radius_voxels / settings.kernel_radius_voxels);
  for (int i = 0; i < kVoxelsPerBlock; ++i) {
    const float added = sums.weight[i] - shares.previous_weight[i];
    if (!(added > 0.0F)) continue;
    auto& count = shares.num_views[static_cast<std::size_t>(i)];
    if (count < 255) ++count;
    shares.widening[i] = std::max(shares.widening[i], widening);
    if (view.has_pose_covariance) {
      const double variance =
          PoseVarianceAt(view, block, i, VectorAt(sums.normal, i), settings.voxel_m);
      shares.shared_variance[i] +=
          static_cast<float>(static_cast<double>(added) * added * variance);
    }
  }
  shares.previous_weight = sums.weight;
}

Surface FitSurface(const PointSums& sums, int order) {
  return order == 2 ? SphereSurface(sums) : PlaneSurface(sums);
}

Voxel MakeVoxel(const KernelSums& sums, const ViewShares& shares, const FieldSettings& settings,
                int i) {
  Voxel voxel;
  const float weight = sums.weight[i];
  if (!(weight > 0.0F)) return voxel;
  const PointSums at = SumsAt(sums, i);
  const double max_offset =
      settings.max_centroid_offset_voxels * static_cast<double>(shares.widening[i]);
  if (!(CentroidOffset(at) <= max_offset)) return voxel;
  const Surface surface = FitSurface(at, settings.order);
  if (!std::isfinite(surface.distance) || !surface.gradient.allFinite()) return voxel;
  const float to_voxels = 1.0F / (weight * static_cast<float>(settings.voxel_m));
  voxel.distance = surface.distance;
  voxel.noise = std::sqrt(sums.variance[i]) * to_voxels;
  voxel.shared = std::sqrt(shares.shared_variance[i]) * to_voxels;
  voxel.weight = weight;
  for (int axis = 0; axis < 3; ++axis) {
    const float component = std::clamp(surface.gradient[axis], -1.0F, 1.0F);
    voxel.gradient[static_cast<std::size_t>(axis)] =
        static_cast<std::int16_t>(std::lround(component * kGradientScale));
  }
  const auto channel = [&](std::size_t c) {
    const float mean = std::clamp(sums.color[c][i] / weight, 0.0F, 255.0F);
    return static_cast<std::uint8_t>(std::lround(mean));
  };
  voxel.color = Rgb8{channel(0), channel(1), channel(2)};
  voxel.num_views = shares.num_views[static_cast<std::size_t>(i)];
  return voxel;
}

std::array<Channel, 3> FindSheets(const std::vector<PlacedView>& views) {
  const auto sheets = std::make_unique<SheetNormals>();
  for (const PlacedView& view : views) {
    const auto radius = static_cast<float>(view.view->radius_voxels);
    for (const Sample& sample : view.samples) AddToSheets(sample, radius, *sheets);
  }
  return sheets->Consensus();
}

// Where wider levels are wanted: they serve the surface, not the far ends of the field.
constexpr float kMaxDistanceVoxels = 2.5F;

bool NearSurface(const Voxel& voxel) {
  return voxel.weight > 0.0F && std::abs(voxel.distance) < kMaxDistanceVoxels;
}

LineMask LinesNearSurface(const BlockField& field) {
  LineMask lines = 0;
  for (int i = 0; i < kVoxelsPerBlock; ++i) {
    if (NearSurface(field.voxels[static_cast<std::size_t>(i)])) {
      lines |= LineMask{1} << (i / kBlockSize);
    }
  }
  return lines;
}

// The normals that level 0 found, for the sheet test of the wider levels.
std::array<Channel, 3> NormalsOf(const BlockField& field) {
  std::array<Channel, 3> normals;
  for (auto& channel : normals) channel.setZero();
  for (int i = 0; i < kVoxelsPerBlock; ++i) {
    const Voxel& voxel = field.voxels[static_cast<std::size_t>(i)];
    if (!(voxel.weight > 0.0F)) continue;
    const Eigen::Vector3f gradient(voxel.gradient[0], voxel.gradient[1], voxel.gradient[2]);
    const float length = gradient.norm();
    if (!(length > 0.0F)) continue;
    for (int axis = 0; axis < 3; ++axis) {
      normals[static_cast<std::size_t>(axis)][i] = gradient[axis] / length;
    }
  }
  return normals;
}

// All views' samples of a cell as one: the sums of the wider levels need not tell views apart.
std::vector<Sample> MergeViews(const std::vector<PlacedView>& views, double radius, int level) {
  const int reach = static_cast<int>(std::ceil(radius)) + 1;
  const int side = ((kBlockSize + 2 * reach) >> level) + 2;
  constexpr int kSides = 6;
  std::vector<int> slot_of_cell(static_cast<std::size_t>(side * side * side * kSides), -1);
  std::vector<std::vector<const Sample*>> slots;
  for (const PlacedView& view : views) {
    for (const Sample& sample : view.samples) {
      int cell = 0;
      for (int axis = 0; axis < 3; ++axis) {
        // Cells are aligned to the block; the bias keeps the coordinate positive.
        const int bias = ((reach >> level) + 1) << level;
        cell =
            cell * side + ((static_cast<int>(std::floor(sample.position[axis])) + bias) >> level);
      }
      int& slot = slot_of_cell[static_cast<std::size_t>(cell * kSides + SideOf(sample.normal))];
      if (slot < 0) {
        slot = static_cast<int>(slots.size());
        slots.emplace_back();
      }
      slots[static_cast<std::size_t>(slot)].push_back(&sample);
    }
  }
  std::vector<Sample> merged;
  merged.reserve(slots.size());
  for (const auto& slot : slots) merged.push_back(MergeSamples(slot));
  return merged;
}

// Views whose samples reach equally far, in the order of their radius.
std::map<double, std::vector<PlacedView>> PlaceByRadius(
    const std::array<int, 3>& block, const std::vector<const ViewSamples*>& views, int level) {
  std::map<double, std::vector<PlacedView>> by_radius;
  for (const ViewSamples* view : views) {
    PlacedView placed = PlaceSamples(block, *view, level);
    if (placed.samples.empty()) continue;
    by_radius[view->radius_voxels * (1 << level)].push_back(std::move(placed));
  }
  return by_radius;
}

void SetLevel(const KernelSums& sums, const FieldSettings& settings, int level, BlockField& field) {
  const auto l = static_cast<std::size_t>(level - 1);
  for (int i = 0; i < kVoxelsPerBlock; ++i) {
    Voxel& voxel = field.voxels[static_cast<std::size_t>(i)];
    if (!NearSurface(voxel) || !(sums.weight[i] > 0.0F)) continue;
    const Surface surface = FitSurface(SumsAt(sums, i), settings.order);
    const float delta = (surface.distance - voxel.distance) * kDeltaScale;
    const float noise =
        std::sqrt(sums.variance[i]) / (sums.weight[i] * static_cast<float>(settings.voxel_m));
    const float ratio = noise / voxel.noise * kRatioScale;
    constexpr float kMaxDelta = 32767.0F;
    if (!(std::abs(delta) < kMaxDelta) || !(ratio < kRatioScale)) continue;
    voxel.delta[l] = static_cast<std::int16_t>(std::lround(delta));
    voxel.noise_ratio[l] = static_cast<std::uint16_t>(std::max(1L, std::lround(ratio)));
  }
}

void AddLevel(const std::array<int, 3>& block, const std::vector<const ViewSamples*>& views,
              const FieldSettings& settings, int level, BlockField& field) {
  const LineMask lines = LinesNearSurface(field);
  if (lines == 0) return;
  const auto by_radius = PlaceByRadius(block, views, level);
  std::unique_ptr<std::array<Channel, 3>> normals;
  for (const auto& [radius, placed] : by_radius) {
    if (normals == nullptr && !AllAgree(placed)) {
      normals = std::make_unique<std::array<Channel, 3>>(NormalsOf(field));
    }
  }
  const auto sums = std::make_unique<KernelSums>();
  for (const auto& [radius, placed] : by_radius) {
    for (const Sample& sample : MergeViews(placed, radius, level)) {
      AddToSums(sample, static_cast<float>(radius), normals.get(), lines, *sums);
    }
  }
  SetLevel(*sums, settings, level, field);
}

// Level 0, the only one that tells views apart.
std::unique_ptr<BlockField> MakeFirstLevel(const std::array<int, 3>& block,
                                           const std::vector<PlacedView>& placed,
                                           const FieldSettings& settings) {
  std::unique_ptr<std::array<Channel, 3>> sheets;
  if (!AllAgree(placed)) sheets = std::make_unique<std::array<Channel, 3>>(FindSheets(placed));
  const auto sums = std::make_unique<KernelSums>();
  const auto shares = std::make_unique<ViewShares>();
  for (const PlacedView& view : placed) {
    const auto radius = static_cast<float>(view.view->radius_voxels);
    for (const Sample& sample : view.samples) {
      AddToSums(sample, radius, sheets.get(), kAllLines, *sums);
    }
    CloseView(*view.view, block, settings, *sums, *shares);
  }
  auto field = std::make_unique<BlockField>();
  for (int i = 0; i < kVoxelsPerBlock; ++i) {
    field->voxels[static_cast<std::size_t>(i)] = MakeVoxel(*sums, *shares, settings, i);
  }
  return field;
}

}  // namespace

std::unique_ptr<BlockField> MakeBlockField(BlockKey block,
                                           const std::vector<const ViewSamples*>& views,
                                           const FieldSettings& settings) {
  const std::array<int, 3> index = UnpackBlock(block);
  std::vector<PlacedView> placed;
  for (const ViewSamples* view : views) {
    PlacedView of_view = PlaceSamples(index, *view, 0);
    if (!of_view.samples.empty()) placed.push_back(std::move(of_view));
  }
  if (placed.empty()) return nullptr;
  std::unique_ptr<BlockField> field = MakeFirstLevel(index, placed, settings);
  for (int level = 1; level < settings.num_levels; ++level) {
    AddLevel(index, views, settings, level, *field);
  }
  CompareLevels(settings.num_levels, *field);
  return field;
}

}  // namespace fringe_fusion::internal
