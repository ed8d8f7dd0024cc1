#include "fringe_fusion/fusion/variational_surface.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "common/constants.hpp"
#include "unsupported.hpp"
#include "variational_band.hpp"
#include "variational_points.hpp"
#include "variational_smoothing.hpp"

namespace fringe_fusion {

using internal::BandBlock;
using internal::BandVoxel;
using internal::BlockKey;
using internal::Center;

namespace {

Result<internal::FitSettings> MakeFitSettings(const VariationalConfig& config) {
  if (Status status = CheckBounds(config, "variational"); !status) return Forward<void>(status);
  const auto kernel = internal::ParseKernel(config.kernel);
  if (!kernel) return Forward(kernel);
  if (config.constraints != "gradient" && config.constraints != "offsets") {
    return Fail("variational: constraints = '{}' is unknown; use gradient or offsets",
                config.constraints);
  }
  internal::FitSettings settings;
  settings.kernel = *kernel;
  settings.use_slopes = config.constraints == "gradient";
  if (settings.use_slopes && !internal::HasHessian(*kernel)) {
    return Fail(
        "variational: constraints = gradient needs a kernel with two derivatives, {} has not; use "
        "constraints = offsets",
        config.kernel);
  }
  settings.slope_sigma = config.slope_sigma;
  settings.slope_ratio = config.slope_ratio;
  return settings;
}

// Usable points, their spacing and noise, and the smoothing that follows.
struct Prepared {
  std::vector<MeasuredPoint> points;
  internal::FitSettings settings;
  VariationalFigures figures;
};

Result<Prepared> Prepare(const std::vector<MeasuredPoint>& points,
                         const VariationalConfig& config) {
  Result<internal::FitSettings> settings = MakeFitSettings(config);
  if (!settings) return Forward(settings);
  Prepared prepared;
  prepared.settings = *settings;
  prepared.points = internal::UsablePoints(points, config.min_sigma_m);
  prepared.figures.num_points = prepared.points.size();
  prepared.figures.num_unusable = points.size() - prepared.points.size();
  constexpr std::size_t kMinPoints = 10;
  if (prepared.points.size() < kMinPoints) {
    return Fail("variational: {} of {} points are usable (finite, with normal and sigma), needs {}",
                prepared.points.size(), points.size(), kMinPoints);
  }
  const internal::SurfaceDensity density = internal::MeasureDensity(prepared.points);
  if (!(density.spacing_m > 0.0)) return Fail("variational: all {} points coincide", points.size());
  if (!(density.sigma_m > 0.0)) {
    return Fail("variational: {} points are too sparse: nowhere do five lie near each other",
                prepared.points.size());
  }
  prepared.figures.spacing_m = density.spacing_m;
  prepared.settings.smoothing.density = 1.0 / (density.spacing_m * density.spacing_m);
  prepared.settings.smoothing.sigma = density.sigma_m;
  prepared.settings.smoothing.width = config.smoothing_width_m;
  prepared.figures.smoothing_width_m = config.smoothing_width_m;
  return prepared;
}

}  // namespace

struct VariationalSurface::Impl {
  VariationalConfig config;
  VariationalFigures figures;
  std::vector<Center> centers;
  std::vector<Rgb8> colors;
  std::vector<std::uint8_t> num_views;
  std::vector<float> sigma;
  std::unique_ptr<internal::CellTree> cells;
  std::vector<BandBlock> blocks;  // ascending

  [[nodiscard]] const BandBlock* Find(BlockKey key) const {
    const auto found =
        std::lower_bound(blocks.begin(), blocks.end(), key,
                         [](const BandBlock& block, BlockKey k) { return block.key < k; });
    return found == blocks.end() || found->key != key ? nullptr : &*found;
  }
  [[nodiscard]] const BandVoxel* FindVoxel(const std::array<int, 3>& voxel) const {
    const bool in_range = std::all_of(voxel.begin(), voxel.end(), [](int value) {
      return std::abs(static_cast<long>(value)) < internal::kMaxVoxelCoordinate;
    });
    const BandBlock* block = in_range ? Find(internal::BlockOfVoxel(voxel)) : nullptr;
    if (block == nullptr) return nullptr;
    const BandVoxel& found = block->voxels[static_cast<std::size_t>(internal::IndexInBlock(voxel))];
    return found.center < 0 ? nullptr : &found;
  }
  [[nodiscard]] FieldSample Describe(std::int32_t center) const {
    const auto i = static_cast<std::size_t>(center);
    FieldSample sample;
    sample.supported = true;
    sample.sigma = sigma[i];
    sample.weight = 1.0F / (sigma[i] * sigma[i]);
    sample.num_views = num_views[i];
    sample.color = colors[i];
    return sample;
  }
  void Merge(const std::vector<MeasuredPoint>& points);
  [[nodiscard]] internal::BandSettings Band() const;
  [[nodiscard]] Status CheckSize() const;
};

void VariationalSurface::Impl::Merge(const std::vector<MeasuredPoint>& points) {
  const double cell_m = config.reduction_ratio * figures.smoothing_width_m;
  internal::MergedPoints merged =
      cell_m > 0.0 ? internal::MergePoints(points, internal::PointGrid(points, cell_m))
                   : internal::KeepPoints(points);
  centers = std::move(merged.centers);
  colors = std::move(merged.colors);
  num_views = std::move(merged.num_views);
  figures.num_centers = centers.size();
}

internal::BandSettings VariationalSurface::Impl::Band() const {
  // A centre stands for its cell of merged points, or for what lies between single ones.
  const double apart =
      std::max(config.reduction_ratio * figures.smoothing_width_m, figures.spacing_m);
  constexpr double kReachInSpacings = 1.3;
  constexpr double kMinReachVoxels = 2.2;
  return {config.voxel_m, kReachInSpacings * apart + kMinReachVoxels * config.voxel_m};
}

Status VariationalSurface::Impl::CheckSize() const {
  for (const Center& center : centers) {
    const double farthest = static_cast<double>(center.position.cwiseAbs().maxCoeff());
    if (farthest / config.voxel_m < internal::kMaxVoxelCoordinate - 64) continue;
    return Fail(
        "variational: a point at {} m from the object frame is beyond {} voxels of {} m; crop it "
        "or use voxel_m >= {:.3g}",
        farthest, internal::kMaxVoxelCoordinate, config.voxel_m,
        farthest / internal::kMaxVoxelCoordinate * 1.1);
  }
  // Every centre touches the blocks within its reach; a cheap bound before they are listed.
  const double spacing =
      std::max(config.reduction_ratio * figures.smoothing_width_m, figures.spacing_m);
  const double area = static_cast<double>(centers.size()) * spacing * spacing;
  const double block_m = internal::kBlockSize * config.voxel_m;
  constexpr double kBlocksPerFace = 3.0;
  const double needed = (kBlocksPerFace * area / (block_m * block_m) *
                             static_cast<double>(internal::kVoxelsPerBlock * sizeof(BandVoxel)) +
                         static_cast<double>(figures.num_points) * 100.0) /
                        kBytesPerGb;
  if (needed <= config.max_memory_gb) return {};
  return Fail(
      "variational: voxel_m = {} needs about {:.2f} GB, limit max_memory_gb = {}; use voxel_m >= "
      "{:.3g}",
      config.voxel_m, needed, config.max_memory_gb,
      config.voxel_m * std::sqrt(needed / config.max_memory_gb) * 1.1);
}

VariationalSurface::VariationalSurface(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
VariationalSurface::VariationalSurface(VariationalSurface&&) noexcept = default;
VariationalSurface& VariationalSurface::operator=(VariationalSurface&&) noexcept = default;
VariationalSurface::~VariationalSurface() = default;

Result<VariationalSurface> VariationalSurface::Fit(const std::vector<MeasuredPoint>& points,
                                                   const VariationalConfig& config,
                                                   const Progress& progress) {
  Result<Prepared> prepared = Prepare(points, config);
  if (!prepared) return Forward(prepared);
  auto impl = std::make_unique<Impl>();
  impl->config = config;
  impl->figures = prepared->figures;
  if (!progress("choose smoothing", 0.0)) return Fail("{}", kCancelled);
  if (config.smoothing_width_m == 0.0) {
    const internal::ChosenWidth chosen = internal::ChooseSmoothing(
        prepared->points, impl->figures.spacing_m, config, prepared->settings);
    impl->figures.smoothing_width_m = chosen.width_m;
    impl->figures.validation_ratio = chosen.score;
  }
  prepared->settings.smoothing.width = impl->figures.smoothing_width_m;
  impl->Merge(prepared->points);
  if (Status status = impl->CheckSize(); !status) return Forward(status);
  std::vector<MeasuredPoint>().swap(prepared->points);

  if (!progress("fit", 0.0)) return Fail("{}", kCancelled);
  impl->cells = std::make_unique<internal::CellTree>(
      impl->centers,
      internal::CellTree::Settings{config.max_cell_centers, config.overlap,
                                   config.margin_widths * impl->figures.smoothing_width_m,
                                   prepared->settings});
  impl->sigma = impl->cells->Fit(impl->centers);
  impl->figures.num_cells = impl->cells->num_cells();
  impl->figures.alpha = impl->cells->max_alpha();
  if (!progress("evaluate", 0.0)) return Fail("{}", kCancelled);
  const internal::BandSettings band = impl->Band();
  impl->blocks = internal::EvaluateBand(impl->centers, *impl->cells,
                                        internal::BandBlocks(impl->centers, band), band);
  if (impl->blocks.empty()) return Fail("variational: no cell could be fitted to the points");
  impl->figures.memory_bytes =
      impl->cells->MemoryBytes() +
      impl->centers.size() * (sizeof(Center) + sizeof(Rgb8) + 1 + sizeof(float)) +
      impl->blocks.size() * (sizeof(BandBlock) + internal::kVoxelsPerBlock * sizeof(BandVoxel));
  return VariationalSurface(std::move(impl));
}

const VariationalFigures& VariationalSurface::figures() const { return impl_->figures; }
double VariationalSurface::voxel_m() const { return impl_->config.voxel_m; }
std::size_t VariationalSurface::NumBlocks() const { return impl_->blocks.size(); }

std::vector<VoxelField::BlockIndex> VariationalSurface::Blocks() const {
  std::vector<BlockIndex> indices;
  indices.reserve(impl_->blocks.size());
  for (const BandBlock& block : impl_->blocks) indices.push_back(internal::UnpackBlock(block.key));
  return indices;
}

FieldSample VariationalSurface::AtVoxel(const std::array<int, 3>& voxel) const {
  const BandVoxel* found = impl_->FindVoxel(voxel);
  if (found == nullptr) return internal::Unsupported();
  FieldSample sample = impl_->Describe(found->center);
  sample.distance = found->distance;
  for (int axis = 0; axis < 3; ++axis) {
    sample.gradient[axis] =
        static_cast<float>(found->gradient[static_cast<std::size_t>(axis)]) / internal::kBandScale;
  }
  return sample;
}

VoxelField::PaddedDistances VariationalSurface::DistancesOf(const BlockIndex& block) const {
  PaddedDistances distances;
  distances.fill(kNan);
  for (int neighbor = 0; neighbor < 8; ++neighbor) {
    const std::array<int, 3> step{neighbor & 1, (neighbor >> 1) & 1, neighbor >> 2};
    const BandBlock* field = impl_->Find(
        internal::PackBlock(block[0] + step[0], block[1] + step[1], block[2] + step[2]));
    if (field == nullptr) continue;
    const auto end = [&](std::size_t axis) { return step[axis] == 1 ? 1 : kBlockSize; };
    for (int z = 0; z < end(2); ++z) {
      for (int y = 0; y < end(1); ++y) {
        for (int x = 0; x < end(0); ++x) {
          const BandVoxel& from =
              field->voxels[static_cast<std::size_t>((z * kBlockSize + y) * kBlockSize + x)];
          if (from.center < 0) continue;
          const int to =
              ((z + step[2] * kBlockSize) * kPaddedSize + y + step[1] * kBlockSize) * kPaddedSize +
              x + step[0] * kBlockSize;
          distances[static_cast<std::size_t>(to)] = from.distance;
        }
      }
    }
  }
  return distances;
}

FieldSample VariationalSurface::Query(const Eigen::Vector3d& point_object) const {
  const Eigen::Vector3d position = point_object / impl_->config.voxel_m;
  if (!(position.cwiseAbs().maxCoeff() < internal::kMaxVoxelCoordinate - 1))
    return internal::Unsupported();
  const Eigen::Vector3i nearest = position.array().round().cast<int>();
  const BandVoxel* voxel = impl_->FindVoxel({nearest[0], nearest[1], nearest[2]});
  if (voxel == nullptr) return internal::Unsupported();
  const Eigen::Vector3f point = point_object.cast<float>();
  const auto value =
      impl_->cells->At(point, impl_->cells->Touching(Eigen::AlignedBox3f(point, point)));
  const float slope = value ? value->gradient.norm() : 0.0F;
  if (!(slope > 0.0F)) return internal::Unsupported();
  FieldSample sample = impl_->Describe(voxel->center);
  sample.distance = value->value / slope;
  sample.gradient = value->gradient / slope;
  return sample;
}

struct VariationalCloud::Impl {
  internal::LocalFit fit;
};

VariationalCloud::VariationalCloud(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
VariationalCloud::VariationalCloud(VariationalCloud&&) noexcept = default;
VariationalCloud& VariationalCloud::operator=(VariationalCloud&&) noexcept = default;
VariationalCloud::~VariationalCloud() = default;

Result<VariationalCloud> VariationalCloud::Fit(const std::vector<MeasuredPoint>& points,
                                               const VariationalConfig& config) {
  const Result<Prepared> prepared = Prepare(points, config);
  if (!prepared) return Forward(prepared);
  constexpr std::size_t kMaxPoints = 6000;
  if (prepared->points.size() > kMaxPoints) {
    return Fail("variational: {} points in one dense system, limit {}", prepared->points.size(),
                kMaxPoints);
  }
  if (!(config.smoothing_width_m > 0.0)) {
    return Fail("variational: one dense system needs smoothing_width_m > 0");
  }
  std::vector<int> order(prepared->points.size());
  std::iota(order.begin(), order.end(), 0);
  auto fit = internal::LocalFit::Solve(internal::KeepPoints(prepared->points).centers, order,
                                       prepared->settings);
  if (!fit) return Fail("variational: the system of {} points cannot be solved", order.size());
  return VariationalCloud(std::make_unique<Impl>(Impl{std::move(*fit)}));
}

double VariationalCloud::Distance(const Eigen::Vector3d& point) const {
  const internal::FitValue value = impl_->fit.At(point.cast<float>());
  return static_cast<double>(value.value / value.gradient.norm());
}

Eigen::Vector3d VariationalCloud::Gradient(const Eigen::Vector3d& point) const {
  return impl_->fit.At(point.cast<float>()).gradient.cast<double>();
}

}  // namespace fringe_fusion
