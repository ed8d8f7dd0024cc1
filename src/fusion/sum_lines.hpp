#pragma once

// The innermost loops of the fusion, without Eigen: one source, compiled for AVX2 and for any
// processor; both give the same bytes.

#include <cstdint>

namespace fringe_fusion::internal {

constexpr float kRadiusInWidths = 2.5F;  ///< R / h: the cut Gaussian has lost 96 % there
/// Cosine between sample and sheet from which on a sample counts fully; it counts nothing at 0.
constexpr float kFullAgreementCosine = 0.5F;

/// The lines (y, z) of a block that are wanted: bit z * 8 + y.
using LineMask = std::uint64_t;

/// A sample in the frame of the block that it is added to [voxels].
struct LineSample {
  float position[3];
  float normal[3];
  float weight;
  float weight_variance;
  float offset_normal;
  float offset_squared;
  float color[3];
};

/// Where the sums of a block lie: 512 numbers each, x fastest.
struct SumChannels {
  float* weight;
  float* offset[3];
  float* normal[3];
  float* offset_normal;
  float* offset_squared;
  float* variance;
  float* color[3];
};

struct SheetChannels {
  float* sum[3];
  float* weight;
  float* nearest2;
  float* nearest[3];
};

struct LineKernels {
  /// @param sheets unit normal of each voxel's sheet, or nullptr.
  void (*add_to_sums)(const LineSample& sample, float radius, const float* const* sheets,
                      LineMask lines, const SumChannels& sums);
  void (*add_to_sheets)(const LineSample& sample, float radius, const SheetChannels& sheets);
};

[[nodiscard]] const LineKernels& PortableLineKernels();
/// The fastest that this processor can run.
[[nodiscard]] const LineKernels& BestLineKernels();

}  // namespace fringe_fusion::internal
