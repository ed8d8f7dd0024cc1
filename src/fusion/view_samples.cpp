#include "view_samples.hpp"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "border_taper.hpp"
#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::internal {
namespace {

// Samples are thinned to one weighted mean per cell of half a voxel: far below the kernel width,
// and it bounds memory and time by the surface's area instead of the camera's pixels.
constexpr int kCellsPerVoxel = 2;
constexpr int kCellBits = 12;  // (8 * 2)^3 cells per block
constexpr double kMaxRadiusVoxels = 16.0;
// The support must hold a few points in each direction, else the field has holes between them.
constexpr double kMinRadiusInSpacings = 2.5;

struct CellSample {
  std::uint64_t key = 0;  // block, then cell
  Sample sample;
};

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

std::uint64_t CellKey(const std::array<int, 3>& voxel, const Eigen::Vector3f& local) {
  std::uint64_t cell = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const int part = std::clamp(static_cast<int>(local[axis] * static_cast<float>(kCellsPerVoxel)),
                                0, kBlockSize * kCellsPerVoxel - 1);
    cell = cell * (kBlockSize * kCellsPerVoxel) + static_cast<std::uint64_t>(part);
  }
  return (BlockOfVoxel(voxel) << kCellBits) | cell;
}

// One point as a sample; nothing when it is invalid, without normal or sigma, or seen from behind.
std::optional<CellSample> MakeSample(const Preparation& preparation, std::size_t i) {
  const RangeImage& range = preparation.view.range;
  if (!range.points[i].allFinite() || !range.normals[i].allFinite()) return std::nullopt;
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

  CellSample cell;
  std::array<int, 3> voxel{};
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    voxel[a] = static_cast<int>(std::floor(position[axis]));
    const int first = FloorDivide(voxel[a], kBlockSize) * kBlockSize;
    cell.sample.position[axis] = static_cast<float>(position[axis] - first);
  }
  cell.key = CellKey(voxel, cell.sample.position);
  cell.sample.normal =
      (preparation.T_object_camera.linear() * normal_camera).normalized().cast<float>();
  const double weight = static_cast<double>(preparation.taper[i]) / variance;
  cell.sample.weight = static_cast<float>(weight);
  cell.sample.weight_variance = static_cast<float>(weight * weight * noise);
  cell.sample.color = range.color[i];
  return cell;
}

std::vector<CellSample> MakeSamples(const Preparation& preparation) {
  const RangeImage& range = preparation.view.range;
  constexpr int kRowsPerChunk = 16;
  const int num_chunks = (range.height + kRowsPerChunk - 1) / kRowsPerChunk;
  std::vector<std::vector<CellSample>> chunks(static_cast<std::size_t>(num_chunks));
  ParallelFor(range.height, kRowsPerChunk, [&](int begin, int end) {
    std::vector<CellSample>& chunk = chunks[static_cast<std::size_t>(begin / kRowsPerChunk)];
    const auto width = static_cast<std::size_t>(range.width);
    for (std::size_t i = static_cast<std::size_t>(begin) * width;
         i < static_cast<std::size_t>(end) * width; ++i) {
      if (const auto sample = MakeSample(preparation, i)) chunk.push_back(*sample);
    }
  });
  std::vector<CellSample> all;
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

// Weighted mean of the samples order[begin .. end) of one cell.
Sample MergeCell(const std::vector<CellSample>& cells,
                 const std::vector<std::pair<std::uint64_t, std::uint32_t>>& order,
                 std::size_t begin, std::size_t end) {
  if (end - begin == 1) return cells[order[begin].second].sample;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  Eigen::Vector3d color = Eigen::Vector3d::Zero();
  double weight = 0.0;
  double weight_variance = 0.0;
  for (std::size_t i = begin; i < end; ++i) {
    const Sample& sample = cells[order[i].second].sample;
    const auto w = static_cast<double>(sample.weight);
    weight += w;
    weight_variance += static_cast<double>(sample.weight_variance);
    position += w * sample.position.cast<double>();
    normal += w * sample.normal.cast<double>();
    color += w * Eigen::Vector3d(sample.color.r, sample.color.g, sample.color.b);
  }
  Sample merged;
  merged.position = (position / weight).cast<float>();
  // All samples of a view face its camera, so their normals cannot cancel.
  merged.normal = normal.normalized().cast<float>();
  merged.weight = static_cast<float>(weight);
  merged.weight_variance = static_cast<float>(weight_variance);
  const auto channel = [&](int c) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(color[c] / weight, 0.0, 255.0)));
  };
  merged.color = Rgb8{channel(0), channel(1), channel(2)};
  return merged;
}

void SortIntoRuns(const std::vector<CellSample>& cells, ViewSamples& view) {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> order(cells.size());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    order[i] = {cells[i].key, static_cast<std::uint32_t>(i)};
  }
  // The pairs are distinct, so the sorted order is unique whatever the number of threads.
  tbb::parallel_sort(order.begin(), order.end());
  for (std::size_t begin = 0; begin < order.size();) {
    std::size_t end = begin + 1;
    while (end < order.size() && order[end].first == order[begin].first) ++end;
    const BlockKey block = order[begin].first >> kCellBits;
    if (view.runs.empty() || view.runs.back().block != block) {
      view.runs.push_back({block, static_cast<std::uint32_t>(view.samples.size())});
    }
    view.samples.push_back(MergeCell(cells, order, begin, end));
    begin = end;
  }
  view.runs.push_back({~BlockKey{0}, static_cast<std::uint32_t>(view.samples.size())});
  view.samples.shrink_to_fit();
  view.runs.shrink_to_fit();
}

Result<double> KernelRadius(const View& view, const FusionConfig& config) {
  const double spacing_m = PointSpacing(view.range);
  const double needed = kMinRadiusInSpacings * spacing_m / config.voxel_m;
  if (!(needed <= kMaxRadiusVoxels)) {
    return Fail(
        "view {} ({}): voxel_m = {} is too fine for points {:.3g} m apart; use voxel_m >= "
        "{:.3g}",
        view.id, view.name, config.voxel_m, spacing_m,
        kMinRadiusInSpacings * spacing_m / kMaxRadiusVoxels * 1.01);
  }
  return std::max(config.kernel_radius_voxels, needed);
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
  const std::vector<CellSample> cells = MakeSamples(preparation);
  if (cells.empty()) {
    return Fail("view {} ({}): none of its {} points has a normal towards the camera and a sigma",
                view.id, view.name, CountValid(view.range));
  }
  SortIntoRuns(cells, samples);
  return samples;
}

std::vector<BlockKey> TouchedBlocks(const ViewSamples& view) {
  std::vector<BlockKey> touched;
  const auto radius = static_cast<float>(view.radius_voxels);
  for (std::size_t run = 0; run + 1 < view.runs.size(); ++run) {
    const std::array<int, 3> block = UnpackBlock(view.runs[run].block);
    Eigen::Vector3f low = Eigen::Vector3f::Constant(kBlockSize);
    Eigen::Vector3f high = Eigen::Vector3f::Zero();
    for (std::uint32_t i = view.runs[run].begin; i < view.runs[run + 1].begin; ++i) {
      low = low.cwiseMin(view.samples[i].position);
      high = high.cwiseMax(view.samples[i].position);
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
