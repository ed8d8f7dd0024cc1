#pragma once

#include <Eigen/Core>
#include <map>
#include <utility>
#include <vector>

#include "fringe_fusion/calibration/target_print.hpp"

namespace fringe_fusion::internal {

/// Distance of places on a target to the edges of its print.
class PrintEdges {
 public:
  explicit PrintEdges(const CalibrationTarget& target);

  /// Distance to the nearest edge within about a pitch [px]; infinite beyond.
  /// @param pixel_by_point derivative of the pixel by the place there.
  [[nodiscard]] double Distance(const Eigen::Vector2d& point,
                                const Eigen::Matrix2d& pixel_by_point) const;

 private:
  [[nodiscard]] std::pair<int, int> Cell(const Eigen::Vector2d& point) const;

  double cell_m_ = 1.0;
  TargetPrint print_;
  std::map<std::pair<int, int>, std::vector<int>> shapes_;  ///< those within a cell of each cell
};

}  // namespace fringe_fusion::internal
