#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion::internal {

/// Points spread evenly over the area of a mesh, the same on every run: sample i stands for the
/// i-th of `count` equal shares of the area in the order of the faces, and lies within its face at
/// a point of a low-discrepancy sequence.
class SurfaceSamples {
 public:
  /// @param use_face flag per face, or empty for all. @param spacing_m root of the area per sample.
  /// @return error when no used face has an area, or more than 2e8 samples would be needed.
  [[nodiscard]] static Result<SurfaceSamples> Create(const Mesh& mesh,
                                                     const std::vector<std::uint8_t>& use_face,
                                                     double spacing_m);
  [[nodiscard]] int count() const { return count_; }
  [[nodiscard]] Eigen::Vector3d At(int sample) const;

 private:
  const Mesh* mesh_ = nullptr;         // borrowed
  std::vector<double> cumulative_m2_;  // area up to and including each face
  int count_ = 0;
};

}  // namespace fringe_fusion::internal
