#pragma once

#include <vector>

#include "view_samples.hpp"

namespace fringe_fusion::internal {

/// A sample and the block it lies in.
struct PlacedSample {
  BlockKey block = 0;
  Sample sample;
};

/// One sample for all that lie in the same cell of 2^level voxels and whose normals point to the
/// same side of the same axis, so that opposite sheets and the faces of an edge stay apart. Means
/// and moments are summed in the order given. Sorted by block and cell.
[[nodiscard]] SampleSet MergeIntoCells(const std::vector<PlacedSample>& samples, int level);

/// The samples of one level merged into those of the next.
[[nodiscard]] SampleSet Coarsen(const SampleSet& finer, int level);

/// The weighted mean of samples whose positions are from the same block.
[[nodiscard]] Sample MergeSamples(const std::vector<const Sample*>& samples);

/// 0..5: axis and side to which a normal mainly points.
[[nodiscard]] int SideOf(const Eigen::Vector3f& normal);

}  // namespace fringe_fusion::internal
