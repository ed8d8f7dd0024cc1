#include "sample_cells.hpp"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace fringe_fusion::internal {
namespace {

constexpr int kCellBits = 12;  // 8^3 cells of a voxel per block, times six sides
constexpr int kSideCount = 8;

std::uint64_t CellKey(BlockKey block, const Sample& sample, int level) {
  std::uint64_t cell = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const int voxel = std::clamp(static_cast<int>(sample.position[axis]), 0, kBlockSize - 1);
    cell = cell * kBlockSize + static_cast<std::uint64_t>(voxel >> level);
  }
  return (block << kCellBits) |
         (cell * kSideCount + static_cast<std::uint64_t>(SideOf(sample.normal)));
}

std::uint8_t MeanChannel(double sum, double weight) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(sum / weight, 0.0, 255.0)));
}

}  // namespace

int SideOf(const Eigen::Vector3f& normal) {
  Eigen::Index axis = 0;
  normal.cwiseAbs().maxCoeff(&axis);
  return static_cast<int>(axis) * 2 + (normal[axis] < 0.0F ? 1 : 0);
}

Sample MergeSamples(const std::vector<const Sample*>& samples) {
  if (samples.size() == 1) return *samples.front();
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  Eigen::Vector3d color = Eigen::Vector3d::Zero();
  double weight = 0.0;
  double weight_variance = 0.0;
  for (const Sample* sample : samples) {
    const auto w = static_cast<double>(sample->weight);
    weight += w;
    weight_variance += static_cast<double>(sample->weight_variance);
    position += w * sample->position.cast<double>();
    normal += w * sample->normal.cast<double>();
    color += w * Eigen::Vector3d(sample->color.r, sample->color.g, sample->color.b);
  }
  position /= weight;
  double offset_normal = 0.0;
  double offset_squared = 0.0;
  for (const Sample* sample : samples) {
    const auto w = static_cast<double>(sample->weight);
    const Eigen::Vector3d from_mean = sample->position.cast<double>() - position;
    offset_normal += w * (static_cast<double>(sample->offset_normal) +
                          from_mean.dot(sample->normal.cast<double>()));
    offset_squared += w * (static_cast<double>(sample->offset_squared) + from_mean.squaredNorm());
  }
  Sample merged;
  merged.position = position.cast<float>();
  merged.normal = (normal / weight).cast<float>();
  merged.weight = static_cast<float>(weight);
  merged.weight_variance = static_cast<float>(weight_variance);
  merged.offset_normal = static_cast<float>(offset_normal / weight);
  merged.offset_squared = static_cast<float>(offset_squared / weight);
  merged.color = Rgb8{MeanChannel(color[0], weight), MeanChannel(color[1], weight),
                      MeanChannel(color[2], weight)};
  return merged;
}

SampleSet MergeIntoCells(const std::vector<PlacedSample>& samples, int level) {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> order(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    order[i] = {CellKey(samples[i].block, samples[i].sample, level), static_cast<std::uint32_t>(i)};
  }
  // The pairs are distinct, so the sorted order is unique whatever the number of threads.
  tbb::parallel_sort(order.begin(), order.end());
  SampleSet set;
  std::vector<const Sample*> in_cell;
  for (std::size_t begin = 0; begin < order.size();) {
    in_cell.clear();
    std::size_t end = begin;
    for (; end < order.size() && order[end].first == order[begin].first; ++end) {
      in_cell.push_back(&samples[order[end].second].sample);
    }
    const BlockKey block = order[begin].first >> kCellBits;
    if (set.runs.empty() || set.runs.back().block != block) {
      set.runs.push_back({block, static_cast<std::uint32_t>(set.samples.size())});
    }
    set.samples.push_back(MergeSamples(in_cell));
    begin = end;
  }
  set.runs.push_back({~BlockKey{0}, static_cast<std::uint32_t>(set.samples.size())});
  set.samples.shrink_to_fit();
  set.runs.shrink_to_fit();
  return set;
}

SampleSet Coarsen(const SampleSet& finer, int level) {
  std::vector<PlacedSample> placed;
  placed.reserve(finer.samples.size());
  for (std::size_t run = 0; run + 1 < finer.runs.size(); ++run) {
    for (std::uint32_t i = finer.runs[run].begin; i < finer.runs[run + 1].begin; ++i) {
      placed.push_back({finer.runs[run].block, finer.samples[i]});
    }
  }
  return MergeIntoCells(placed, level);
}

}  // namespace fringe_fusion::internal
