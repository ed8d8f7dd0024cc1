#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "block_key.hpp"
#include "fringe_fusion/pose/view.hpp"

namespace fringe_fusion::internal {

/// One oriented sample of a view, or the weighted mean of the samples of one half-voxel cell.
struct Sample {
  Eigen::Vector3f position;      ///< from the first voxel of the sample's block [voxels]
  Eigen::Vector3f normal;        ///< unit, object frame
  float weight = 0.0F;           ///< sum of taper / sigma_n^2 [1/m^2]
  float weight_variance = 0.0F;  ///< sum of weight^2 sigma^2 over its points [1/m^2]
  Rgb8 color;
};

/// The samples of one block: samples[begin .. end of the next run).
struct SampleRun {
  BlockKey block = 0;
  std::uint32_t begin = 0;
};

/// The oriented samples of one view in the object frame, sorted by block.
struct ViewSamples {
  int id = 0;
  double radius_voxels = 0.0;  ///< support R of every sample of this view
  std::vector<Sample> samples;
  std::vector<SampleRun> runs;  ///< ascending block; a last run without samples closes the list
  bool has_pose_covariance = false;
  Transform T_camera_object = Transform::Identity();
  Matrix6d pose_covariance = Matrix6d::Zero();

  [[nodiscard]] std::size_t MemoryBytes() const {
    return samples.capacity() * sizeof(Sample) + runs.capacity() * sizeof(SampleRun);
  }
};

/// Turns a view into weighted, oriented samples.
/// @return error when the view is invalid, no point has normal and sigma, a point lies out of the
/// range of voxel indices, or the kernel would need too many voxels for the view's point spacing.
[[nodiscard]] Result<ViewSamples> MakeViewSamples(const View& view, const FusionConfig& config);

/// Blocks within reach of the samples, ascending, each once.
[[nodiscard]] std::vector<BlockKey> TouchedBlocks(const ViewSamples& view);

/// Variance of the position along a unit normal that the pose covariance causes [m^2].
/// With T Exp(xi): n . dp = rotation . (p_camera x n_camera) + translation . n_camera.
[[nodiscard]] double PoseVariance(const Matrix6d& covariance, const Eigen::Vector3d& point_camera,
                                  const Eigen::Vector3d& normal_camera);

}  // namespace fringe_fusion::internal
