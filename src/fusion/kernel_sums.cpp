#include "kernel_sums.hpp"

#include <algorithm>
#include <cmath>

namespace fringe_fusion::internal {
namespace {

LineSample ToLineSample(const Sample& sample) {
  const Eigen::Vector3f& p = sample.position;
  const Eigen::Vector3f& n = sample.normal;
  return {{p[0], p[1], p[2]},
          {n[0], n[1], n[2]},
          sample.weight,
          sample.weight_variance,
          sample.offset_normal,
          sample.offset_squared,
          {static_cast<float>(sample.color.r), static_cast<float>(sample.color.g),
           static_cast<float>(sample.color.b)}};
}

SumChannels ChannelsOf(KernelSums& sums) {
  return {sums.weight.data(),
          {sums.offset[0].data(), sums.offset[1].data(), sums.offset[2].data()},
          {sums.normal[0].data(), sums.normal[1].data(), sums.normal[2].data()},
          sums.offset_normal.data(),
          sums.offset_squared.data(),
          sums.variance.data(),
          {sums.color[0].data(), sums.color[1].data(), sums.color[2].data()}};
}

}  // namespace

std::array<Channel, 3> SheetNormals::Consensus() const {
  // Two opposite sheets that weigh the same cancel; below this ratio the mean says nothing.
  constexpr float kClearRatio = 0.5F;
  std::array<Channel, 3> consensus;
  for (auto& channel : consensus) channel.setZero();
  for (int i = 0; i < kVoxelsPerBlock; ++i) {
    Eigen::Vector3f normal(sum[0][i], sum[1][i], sum[2][i]);
    if (!(normal.norm() >= kClearRatio * weight[i]) || !(weight[i] > 0.0F)) {
      normal = Eigen::Vector3f(nearest[0][i], nearest[1][i], nearest[2][i]);
    }
    const float length = normal.norm();
    if (!(length > 0.0F)) continue;
    for (int axis = 0; axis < 3; ++axis) {
      consensus[static_cast<std::size_t>(axis)][i] = normal[axis] / length;
    }
  }
  return consensus;
}

void AddToSums(const Sample& sample, float radius_voxels, const std::array<Channel, 3>* sheets,
               LineMask lines, KernelSums& sums) {
  const SumChannels channels = ChannelsOf(sums);
  std::array<const float*, 3> normals{};
  for (std::size_t axis = 0; sheets != nullptr && axis < 3; ++axis) {
    normals[axis] = (*sheets)[axis].data();
  }
  BestLineKernels().add_to_sums(ToLineSample(sample), radius_voxels,
                                sheets != nullptr ? normals.data() : nullptr, lines, channels);
}

void AddToSheets(const Sample& sample, float radius_voxels, SheetNormals& sheets) {
  const SheetChannels channels{
      {sheets.sum[0].data(), sheets.sum[1].data(), sheets.sum[2].data()},
      sheets.weight.data(),
      sheets.nearest2.data(),
      {sheets.nearest[0].data(), sheets.nearest[1].data(), sheets.nearest[2].data()}};
  BestLineKernels().add_to_sheets(ToLineSample(sample), radius_voxels, channels);
}

}  // namespace fringe_fusion::internal
