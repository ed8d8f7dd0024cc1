#include "kernel_sums.hpp"

#include <algorithm>
#include <cmath>

namespace fringe_fusion::internal {
namespace {

template <typename ChannelType>
auto LineAt(ChannelType& channel, int start) {
  return channel.template segment<kBlockSize>(start);
}

// 0 for opposite or perpendicular normals, 1 for those that agree, linear between.
Line Agreement(const std::array<Channel, 3>& sheets, const Eigen::Vector3f& normal, int start) {
  const Line cosine = LineAt(sheets[0], start) * normal[0] + LineAt(sheets[1], start) * normal[1] +
                      LineAt(sheets[2], start) * normal[2];
  return (cosine * (1.0F / kFullAgreementCosine)).max(0.0F).min(1.0F);
}

void AddLine(const SampleKernel& kernel, const Line& k, int y, int z, KernelSums& sums) {
  const Sample& sample = kernel.sample;
  const int start = (z * kBlockSize + y) * kBlockSize;
  const float gap_y = kernel.gap[1][y];
  const float gap_z = kernel.gap[2][z];
  const Line w = k * sample.weight;
  const Line w_x = w * kernel.gap[0];
  const Line off_normal =
      kernel.gap[0] * sample.normal[0] +
      (gap_y * sample.normal[1] + gap_z * sample.normal[2] + sample.offset_normal);
  LineAt(sums.weight, start) += w;
  LineAt(sums.offset[0], start) += w_x;
  LineAt(sums.offset[1], start) += w * gap_y;
  LineAt(sums.offset[2], start) += w * gap_z;
  LineAt(sums.normal[0], start) += w * sample.normal[0];
  LineAt(sums.normal[1], start) += w * sample.normal[1];
  LineAt(sums.normal[2], start) += w * sample.normal[2];
  LineAt(sums.offset_normal, start) += w * off_normal;
  LineAt(sums.offset_squared, start) +=
      w_x * kernel.gap[0] + w * (gap_y * gap_y + gap_z * gap_z + sample.offset_squared);
  LineAt(sums.variance, start) += k * k * sample.weight_variance;
  LineAt(sums.color[0], start) += w * static_cast<float>(sample.color.r);
  LineAt(sums.color[1], start) += w * static_cast<float>(sample.color.g);
  LineAt(sums.color[2], start) += w * static_cast<float>(sample.color.b);
}

}  // namespace

SampleKernel::SampleKernel(const Sample& placed_sample, float radius_voxels)
    : sample(placed_sample),
      radius2(radius_voxels * radius_voxels),
      inverse_radius2(1.0F / (radius_voxels * radius_voxels)) {
  const Line voxel = Line::LinSpaced(0.0F, static_cast<float>(kBlockSize - 1));
  const float exponent = -0.5F * kRadiusInWidths * kRadiusInWidths * inverse_radius2;
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    const float position = sample.position[axis];
    gap[a] = position - voxel;
    gap_squared[a] = gap[a].square();
    gauss[a] = (gap_squared[a] * exponent).exp();
    first[a] = std::max(0, static_cast<int>(std::ceil(position - radius_voxels)));
    last[a] = std::min(kBlockSize - 1, static_cast<int>(std::floor(position + radius_voxels)));
  }
}

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

void AddToSums(const SampleKernel& kernel, const std::array<Channel, 3>* sheets, LineMask lines,
               KernelSums& sums) {
  for (int z = kernel.first[2]; z <= kernel.last[2]; ++z) {
    for (int y = kernel.first[1]; y <= kernel.last[1]; ++y) {
      if (((lines >> (z * kBlockSize + y)) & 1U) == 0 || !kernel.Reaches(y, z)) continue;
      Line k = kernel.On(y, z);
      if (sheets != nullptr) {
        k *= Agreement(*sheets, kernel.sample.normal, (z * kBlockSize + y) * kBlockSize);
      }
      AddLine(kernel, k, y, z, sums);
    }
  }
}

void AddToSheets(const SampleKernel& kernel, SheetNormals& sheets) {
  const Eigen::Vector3f& normal = kernel.sample.normal;
  for (int z = kernel.first[2]; z <= kernel.last[2]; ++z) {
    for (int y = kernel.first[1]; y <= kernel.last[1]; ++y) {
      if (!kernel.Reaches(y, z)) continue;
      const int start = (z * kBlockSize + y) * kBlockSize;
      const Line k4 = kernel.On(y, z).square().square();
      LineAt(sheets.weight, start) += k4;
      const Line distance2 =
          kernel.gap_squared[0] + (kernel.gap_squared[1][y] + kernel.gap_squared[2][z]);
      const Eigen::Array<bool, kBlockSize, 1> nearer = distance2 < LineAt(sheets.nearest2, start);
      LineAt(sheets.nearest2, start) = nearer.select(distance2, LineAt(sheets.nearest2, start));
      for (int axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<std::size_t>(axis);
        LineAt(sheets.sum[a], start) += k4 * normal[axis];
        LineAt(sheets.nearest[a], start) =
            nearer.select(Line::Constant(normal[axis]), LineAt(sheets.nearest[a], start));
      }
    }
  }
}

}  // namespace fringe_fusion::internal
