#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "block_key.hpp"
#include "fringe_fusion/pose/view.hpp"

namespace fringe_fusion::internal {

/// The oriented points of one cell: their weighted means and the moments about them, so that every
/// sum over the points is exact under a kernel that is constant within the cell.
struct Sample {
  Eigen::Vector3f position;      ///< from the first voxel of the sample's block [voxels]
  Eigen::Vector3f normal;        ///< mean of the unit normals, object frame
  float weight = 0.0F;           ///< sum of taper / sigma_n^2 [1/m^2]
  float weight_variance = 0.0F;  ///< sum of weight^2 sigma^2 over its points [1/m^2]
  float offset_normal = 0.0F;    ///< mean of (p - position) . n [voxels]
  float offset_squared = 0.0F;   ///< mean of |p - position|^2 [voxels^2]
  Rgb8 color;
};

/// The samples of one block: samples[begin .. end of the next run).
struct SampleRun {
  BlockKey block = 0;
  std::uint32_t begin = 0;
};

/// Samples sorted by block.
struct SampleSet {
  std::vector<Sample> samples;
  std::vector<SampleRun> runs;  ///< ascending block; a last run without samples closes the list
};

/// Octaves of the kernel: level l has 2^l times the reach of level 0 and cells of 2^l voxels.
constexpr int kMaxLevels = 3;

/// The oriented samples of one view in the object frame.
struct ViewSamples {
  int id = 0;
  double radius_voxels = 0.0;  ///< support R of every sample of this view at level 0
  std::array<SampleSet, kMaxLevels> levels;
  bool has_pose_covariance = false;
  Transform T_camera_object = Transform::Identity();
  Matrix6d pose_covariance = Matrix6d::Zero();

  [[nodiscard]] std::size_t MemoryBytes() const {
    std::size_t bytes = 0;
    for (const SampleSet& set : levels) {
      bytes += set.samples.capacity() * sizeof(Sample) + set.runs.capacity() * sizeof(SampleRun);
    }
    return bytes;
  }
};

/// Turns a view into weighted, oriented samples.
/// @return error when the view is invalid, no point has normal and sigma, a point lies out of the
/// range of voxel indices, or the kernel would need too many voxels for the view's point spacing.
[[nodiscard]] Result<ViewSamples> MakeViewSamples(const View& view, const FusionConfig& config);

/// Blocks within reach of the samples at a level, ascending, each once.
[[nodiscard]] std::vector<BlockKey> TouchedBlocks(const ViewSamples& view, int level);

/// Variance of the position along a unit normal that the pose covariance causes [m^2].
/// With T Exp(xi): n . dp = rotation . (p_camera x n_camera) + translation . n_camera.
[[nodiscard]] double PoseVariance(const Matrix6d& covariance, const Eigen::Vector3d& point_camera,
                                  const Eigen::Vector3d& normal_camera);

}  // namespace fringe_fusion::internal
