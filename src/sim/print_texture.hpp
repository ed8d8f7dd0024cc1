#pragma once

#include <Eigen/Core>
#include <map>
#include <utility>
#include <vector>

#include "fringe_fusion/sim/target_plate.hpp"

namespace fringe_fusion::sim {

/// Lightness of a printed plate, averaged over small areas so that edges lie where they are meant
/// to, far below a pixel.
class PrintTexture {
 public:
  explicit PrintTexture(const SurfacePrint& print);

  /// @param point_object on the plate. @param across_object,down_object sides of the area that is
  /// averaged, along the plate.
  /// @return 0 black to 1 white; 1 beside the plate.
  [[nodiscard]] double Lightness(const Eigen::Vector3d& point_object,
                                 const Eigen::Vector3d& across_object,
                                 const Eigen::Vector3d& down_object) const;

 private:
  [[nodiscard]] std::pair<int, int> Cell(const Eigen::Vector2d& point) const;

  SurfacePrint print_;
  Transform T_target_object_;
  double cell_m_ = 1.0;
  std::map<std::pair<int, int>, std::vector<int>> shapes_;  ///< those that reach into a cell
};

}  // namespace fringe_fusion::sim
