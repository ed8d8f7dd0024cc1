#include "view_samples.hpp"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "border_taper.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/triangulation/point_spacing.hpp"
#include "kernel_sums.hpp"
#include "normal_noise.hpp"
#include "sample_cells.hpp"

namespace fringe_fusion::internal {
namespace {

constexpr double kMaxRadiusVoxels = 16.0;
// The support must hold a few points in each direction, else the field has holes between them.
constexpr double kMinRadiusInSpacings = 1.6;

struct Preparation {
  const View& view;
  double voxel_m;
  double min_sigma_m;
  Image<float> taper;
  Transform T_object_camera;
  bool has_pose_covariance;
};

Status CheckImages(const View& view) {
  if (Status status = Validate(view); !status) return status;
  const RangeImage& range = view.range;
  const auto fits = [&](const auto& image) {
    return image.width() == range.width && image.height() == range.height;
  };
  if (!fits(range.points) || !fits(range.normals) || !fits(range.sigma_range) ||
      !fits(range.sigma_lateral) || !fits(range.color)) {
    return Fail("view {} ({}): points, normals, sigma and colour must all be {} x {} pixels",
                view.id, view.name, range.width, range.height);
  }
  return {};
}

// Variance of one point along its normal, of its own noise alone [m^2]; negative if unusable.
double NoiseVariance(const RangeImage& range, std::size_t i, double min_sigma_m) {
  const Eigen::Vector3f to_camera = DirectionToCamera(range.line_of_sight, range.points[i]);
  const auto cosine = static_cast<double>(range.normals[i].dot(to_camera));
  const auto along = static_cast<double>(range.sigma_range[i]);
  const auto across = static_cast<double>(range.sigma_lateral[i]);
  const double cosine2 = std::min(1.0, cosine * cosine);
  const double variance = along * along * cosine2 + across * across * (1.0 - cosine2);
  if (!(cosine > 0.0) || !(variance >= 0.0) || !std::isfinite(variance)) return -1.0;
  return std::max(variance, min_sigma_m * min_sigma_m);
}

// One point as a sample; nothing when it is invalid, without normal or sigma, or seen from behind.
std::optional<PlacedSample> MakeSample(const Preparation& preparation, std::size_t i) {
  const RangeImage& range = preparation.view.range;
  if (!range.points[i].allFinite() || !range.normals[i].allFinite()) return std::nullopt;
  if (!(preparation.taper[i] > 0.0F)) return std::nullopt;
  const double noise = NoiseVariance(range, i, preparation.min_sigma_m);
  if (!(noise > 0.0)) return std::nullopt;
  const Eigen::Vector3d point_camera = range.points[i].cast<double>();
  const Eigen::Vector3d normal_camera = range.normals[i].cast<double>().normalized();
  double variance = noise;
  if (preparation.has_pose_covariance) {
    variance += PoseVariance(preparation.view.pose.covariance, point_camera, normal_camera);
  }
  const Eigen::Vector3d position = preparation.T_object_camera * point_camera / preparation.voxel_m;
  if (!(position.cwiseAbs().maxCoeff() < kMaxVoxelCoordinate)) return std::nullopt;

  PlacedSample placed;
  std::array<int, 3> voxel{};
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    voxel[a] = static_cast<int>(std::floor(position[axis]));
    const int first = FloorDivide(voxel[a], kBlockSize) * kBlockSize;
    placed.sample.position[axis] = static_cast<float>(position[axis] - first);
  }
  placed.block = BlockOfVoxel(voxel);
  placed.sample.normal =
      (preparation.T_object_camera.linear() * normal_camera).normalized().cast<float>();
  const double weight = static_cast<double>(preparation.taper[i]) / variance;
  placed.sample.weight = static_cast<float>(weight);
  placed.sample.weight_variance = static_cast<float>(weight * weight * noise);
  placed.sample.color = range.color[i];
  return placed;
}

std::vector<PlacedSample> MakeSamples(const Preparation& preparation) {
  const RangeImage& range = preparation.view.range;
  constexpr int kRowsPerChunk = 16;
  const int num_chunks = (range.height + kRowsPerChunk - 1) / kRowsPerChunk;
  std::vector<std::vector<PlacedSample>> chunks(static_cast<std::size_t>(num_chunks));
  ParallelFor(range.height, kRowsPerChunk, [&](int begin, int end) {
    std::vector<PlacedSample>& chunk = chunks[static_cast<std::size_t>(begin / kRowsPerChunk)];
    const auto width = static_cast<std::size_t>(range.width);
    for (std::size_t i = static_cast<std::size_t>(begin) * width;
         i < static_cast<std::size_t>(end) * width; ++i) {
      if (const auto sample = MakeSample(preparation, i)) chunk.push_back(*sample);
    }
  });
  std::vector<PlacedSample> all;
  for (const auto& chunk : chunks) all.insert(all.end(), chunk.begin(), chunk.end());
  return all;
}

// A point too far out for the voxel indices; such a view is refused as a whole.
Status CheckExtent(const View& view, const FusionConfig& config) {
  for (const Eigen::Vector3f& point : view.range.points) {
    if (!point.allFinite()) continue;
    const double farthest =
        (view.pose.T_object_camera * point.cast<double>()).cwiseAbs().maxCoeff();
    if (farthest / config.voxel_m < kMaxVoxelCoordinate) continue;
    return Fail(
        "view {} ({}): a point at {} m from the object frame is beyond {} voxels of {} m; "
        "crop it or use voxel_m >= {:.3g}",
        view.id, view.name, farthest, kMaxVoxelCoordinate, config.voxel_m,
        farthest / kMaxVoxelCoordinate * 1.1);
  }
  return {};
}

Result<double> KernelRadius(const View& view, const FusionConfig& config) {
  const double fill_ratio = FillRatio(view.range);
  const double spacing_m =
      PointSpacing(view.range) / (fill_ratio > 0.0 ? std::sqrt(fill_ratio) : 1.0);
  const double needed = kMinRadiusInSpacings * spacing_m / config.voxel_m;
  if (!(needed <= kMaxRadiusVoxels)) {
    return Fail(
        "view {} ({}): voxel_m = {} is too fine for points {:.3g} m apart; use voxel_m >= "
        "{:.3g}",
        view.id, view.name, config.voxel_m, spacing_m,
        kMinRadiusInSpacings * spacing_m / kMaxRadiusVoxels * 1.01);
  }
  // Few distinct radii, so that the samples of different views can be merged at the wider levels.
  double radius = config.kernel_radius_voxels;
  while (radius < needed) radius *= M_SQRT2;
  return radius;
}

// The samples of all levels; the wider ones are merged from those of the level before.
void FillLevels(const std::vector<PlacedSample>& points, double spacing_voxels,
                const FusionConfig& config, ViewSamples& view) {
  view.levels[0] = MergeIntoCells(points, 0);
  for (int level = 1; level < config.num_levels; ++level) {
    const auto l = static_cast<std::size_t>(level);
    view.levels[l] = Coarsen(view.levels[l - 1], level);
  }
  if (config.normal_radius_px == 0) return;
  for (int level = 0; level < config.num_levels; ++level) {
    const double h = view.radius_voxels * (1 << level) / static_cast<double>(kRadiusInWidths);
    const double window = (config.normal_radius_px + 0.5) * spacing_voxels;
    const auto factor = static_cast<float>(NormalNoiseFactor(window / h, config.order));
    for (Sample& sample : view.levels[static_cast<std::size_t>(level)].samples) {
      sample.weight_variance *= factor;
    }
  }
}

}  // namespace

double PoseVariance(const Matrix6d& covariance, const Eigen::Vector3d& point_camera,
                    const Eigen::Vector3d& normal_camera) {
  Vector6d jacobian;
  jacobian << point_camera.cross(normal_camera), normal_camera;
  return std::max(0.0, jacobian.dot(covariance * jacobian));
}

Result<ViewSamples> MakeViewSamples(const View& view, const FusionConfig& config) {
  if (Status status = CheckImages(view); !status) return Forward<void>(status);
  if (Status status = CheckExtent(view, config); !status) return Forward<void>(status);
  const Result<double> radius = KernelRadius(view, config);
  if (!radius) return Forward(radius);

  ViewSamples samples;
  samples.id = view.id;
  samples.radius_voxels = *radius;
  samples.has_pose_covariance = view.pose.covariance.diagonal().maxCoeff() > 0.0;
  samples.pose_covariance = view.pose.covariance;
  samples.T_camera_object = view.pose.T_object_camera.inverse();
  const Preparation preparation{view,
                                config.voxel_m,
                                config.min_sigma_m,
                                BorderTaper(view.range, config.border_taper_px, config.voxel_m),
                                view.pose.T_object_camera,
                                samples.has_pose_covariance};
  const std::vector<PlacedSample> points = MakeSamples(preparation);
  if (points.empty()) {
    return Fail("view {} ({}): none of its {} points has a normal towards the camera and a sigma",
                view.id, view.name, CountValid(view.range));
  }
  FillLevels(points, PointSpacing(view.range) / config.voxel_m, config, samples);
  return samples;
}

std::vector<BlockKey> TouchedBlocks(const ViewSamples& view, int level) {
  const std::vector<SampleRun>& runs = view.levels[static_cast<std::size_t>(level)].runs;
  const std::vector<Sample>& samples = view.levels[static_cast<std::size_t>(level)].samples;
  std::vector<BlockKey> touched;
  const auto radius = static_cast<float>(view.radius_voxels * (1 << level));
  for (std::size_t run = 0; run + 1 < runs.size(); ++run) {
    const std::array<int, 3> block = UnpackBlock(runs[run].block);
    Eigen::Vector3f low = Eigen::Vector3f::Constant(kBlockSize);
    Eigen::Vector3f high = Eigen::Vector3f::Zero();
    for (std::uint32_t i = runs[run].begin; i < runs[run + 1].begin; ++i) {
      low = low.cwiseMin(samples[i].position);
      high = high.cwiseMax(samples[i].position);
    }
    std::array<int, 3> first{};
    std::array<int, 3> last{};
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<std::size_t>(axis);
      first[a] = FloorDivide(static_cast<int>(std::ceil(low[axis] - radius)), kBlockSize);
      last[a] = FloorDivide(static_cast<int>(std::floor(high[axis] + radius)), kBlockSize);
    }
    for (int x = first[0]; x <= last[0]; ++x) {
      for (int y = first[1]; y <= last[1]; ++y) {
        for (int z = first[2]; z <= last[2]; ++z) {
          touched.push_back(PackBlock(block[0] + x, block[1] + y, block[2] + z));
        }
      }
    }
  }
  tbb::parallel_sort(touched.begin(), touched.end());
  touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
  return touched;
}

}  // namespace fringe_fusion::internal
