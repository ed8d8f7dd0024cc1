#include "block_field.hpp"

#include <algorithm>
#include <cmath>

#include "kernel_sums.hpp"

namespace fringe_fusion::internal {
namespace {

// Samples of one view within reach of a block, placed in the block's frame.
struct PlacedSamples {
  const ViewSamples* view = nullptr;
  std::vector<Sample> samples;
};

// Squared distance from a point to the box of the block's voxels.
float DistanceToVoxels2(const Eigen::Vector3f& position) {
  constexpr auto kLast = static_cast<float>(kBlockSize - 1);
  const Eigen::Vector3f nearest = position.cwiseMax(0.0F).cwiseMin(kLast);
  return (position - nearest).squaredNorm();
}

PlacedSamples PlaceSamples(const std::array<int, 3>& block, const ViewSamples& view) {
  PlacedSamples placed{&view, {}};
  const int reach = (static_cast<int>(std::ceil(view.radius_voxels)) - 1) / kBlockSize + 1;
  const auto radius2 = static_cast<float>(view.radius_voxels * view.radius_voxels);
  for (int x = block[0] - reach; x <= block[0] + reach; ++x) {
    for (int y = block[1] - reach; y <= block[1] + reach; ++y) {
      const BlockKey first = PackBlock(x, y, block[2] - reach);
      const BlockKey last = PackBlock(x, y, block[2] + reach);
      auto run = std::lower_bound(view.runs.begin(), view.runs.end(), first,
                                  [](const SampleRun& r, BlockKey key) { return r.block < key; });
      for (; run->block <= last; ++run) {
        const std::array<int, 3> from = UnpackBlock(run->block);
        const Eigen::Vector3f shift =
            Eigen::Vector3i(from[0] - block[0], from[1] - block[1], from[2] - block[2])
                .cast<float>() *
            static_cast<float>(kBlockSize);
        for (std::uint32_t i = run->begin; i < (run + 1)->begin; ++i) {
          Sample sample = view.samples[i];
          sample.position += shift;
          if (DistanceToVoxels2(sample.position) < radius2) placed.samples.push_back(sample);
        }
      }
    }
  }
  return placed;
}

// True when any two normals differ by at most 60 deg: then the sheet test cannot exclude anything.
bool AllAgree(const std::vector<PlacedSamples>& views) {
  constexpr float kCos30 = 0.8660254F;
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (const PlacedSamples& view : views) {
    for (const Sample& sample : view.samples) sum += sample.normal;
  }
  const Eigen::Vector3f mean = sum.normalized();
  for (const PlacedSamples& view : views) {
    for (const Sample& sample : view.samples) {
      if (!(sample.normal.dot(mean) >= kCos30)) return false;
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

struct Surface {
  float distance = 0.0F;  // [voxels]
  Eigen::Vector3f gradient = Eigen::Vector3f::Zero();
};

// Order 0, the generalised implicit equation: D = -S3 / W.
Surface PlaneSurface(const KernelSums& sums, int i) {
  const float weight = sums.weight[i];
  return {-sums.offset_normal[i] / weight, VectorAt(sums.normal, i) / weight};
}

// Order 2: distance to the algebraic sphere u0 + u.x + u4 |x|^2 fitted to the sums; order 0 where
// the fit is not a surface near the voxel.
Surface SphereSurface(const KernelSums& sums, int i) {
  const auto weight = static_cast<double>(sums.weight[i]);
  const Eigen::Vector3d s1 = VectorAt(sums.offset, i).cast<double>();
  const Eigen::Vector3d s2 = VectorAt(sums.normal, i).cast<double>();
  const auto s3 = static_cast<double>(sums.offset_normal[i]);
  const auto s4 = static_cast<double>(sums.offset_squared[i]);
  const double spread = s4 - s1.squaredNorm() / weight;
  // Samples closer together than a fraction of a voxel carry no curvature.
  constexpr double kMinSpread = 0.05;
  if (!(spread > kMinSpread * weight)) return PlaneSurface(sums, i);
  const double u4 = (s3 - s1.dot(s2) / weight) / (2.0 * spread);
  const Eigen::Vector3d u = (s2 - 2.0 * u4 * s1) / weight;
  const double u0 = -(u.dot(s1) + u4 * s4) / weight;
  const double discriminant = u.squaredNorm() - 4.0 * u0 * u4;
  // A sphere of less than a voxel's radius, or one the voxel sits in the middle of, is no surface.
  constexpr double kMaxCurvature = 0.5;
  if (!(discriminant > 0.25 * u.squaredNorm()) || !(std::abs(u4) < kMaxCurvature * u.norm())) {
    return PlaneSurface(sums, i);
  }
  const double distance = 2.0 * u0 / (u.norm() + std::sqrt(discriminant));
  return {static_cast<float>(distance), u.normalized().cast<float>()};
}

// Along the surface only: a voxel off the surface has its centroid that far along the normal.
float CentroidOffset(const KernelSums& sums, int i) {
  const Eigen::Vector3f centroid = VectorAt(sums.offset, i) / sums.weight[i];
  const Eigen::Vector3f normal = VectorAt(sums.normal, i).normalized();
  return (centroid - normal * normal.dot(centroid)).norm();
}

Voxel MakeVoxel(const KernelSums& sums, const ViewShares& shares, const FieldSettings& settings,
                int i) {
  Voxel voxel;
  const float weight = sums.weight[i];
  const auto max_offset = static_cast<float>(settings.max_centroid_offset_voxels);
  if (!(weight > 0.0F)) return voxel;
  if (!(CentroidOffset(sums, i) <= max_offset * shares.widening[i])) return voxel;
  const Surface surface = settings.order == 2 ? SphereSurface(sums, i) : PlaneSurface(sums, i);
  if (!std::isfinite(surface.distance) || !surface.gradient.allFinite()) return voxel;
  voxel.distance = surface.distance;
  voxel.sigma = std::sqrt(sums.variance[i] + shares.shared_variance[i]) / weight;
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

std::array<Channel, 3> FindSheets(const std::vector<PlacedSamples>& views) {
  const auto sheets = std::make_unique<SheetNormals>();
  for (const PlacedSamples& view : views) {
    const auto radius = static_cast<float>(view.view->radius_voxels);
    for (const Sample& sample : view.samples) AddToSheets(SampleKernel(sample, radius), *sheets);
  }
  return sheets->Consensus();
}

}  // namespace

std::unique_ptr<BlockField> MakeBlockField(BlockKey block,
                                           const std::vector<const ViewSamples*>& views,
                                           const FieldSettings& settings) {
  const std::array<int, 3> index = UnpackBlock(block);
  std::vector<PlacedSamples> placed;
  for (const ViewSamples* view : views) {
    PlacedSamples of_view = PlaceSamples(index, *view);
    if (!of_view.samples.empty()) placed.push_back(std::move(of_view));
  }
  if (placed.empty()) return nullptr;

  std::unique_ptr<std::array<Channel, 3>> sheets;
  if (!AllAgree(placed)) sheets = std::make_unique<std::array<Channel, 3>>(FindSheets(placed));
  const auto sums = std::make_unique<KernelSums>();
  const auto shares = std::make_unique<ViewShares>();
  for (const PlacedSamples& view : placed) {
    const auto radius = static_cast<float>(view.view->radius_voxels);
    for (const Sample& sample : view.samples) {
      AddToSums(SampleKernel(sample, radius), sheets.get(), *sums);
    }
    CloseView(*view.view, index, settings, *sums, *shares);
  }
  auto field = std::make_unique<BlockField>();
  for (int i = 0; i < kVoxelsPerBlock; ++i) {
    (*field)[static_cast<std::size_t>(i)] = MakeVoxel(*sums, *shares, settings, i);
  }
  return field;
}

}  // namespace fringe_fusion::internal
