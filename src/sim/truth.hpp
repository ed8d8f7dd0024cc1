#pragma once

#include "view_samples.hpp"

namespace fringe_fusion::sim {

/// Exact answers of one pose from its rays.
[[nodiscard]] ViewTruth MakeTruth(const RayScene& scene, const CellCalibration& calibration,
                                  const ViewSamples& view, const Image<Eigen::Vector2d>& rays,
                                  const Transform& T_object_camera);

}  // namespace fringe_fusion::sim
