#pragma once

#include <array>

#include "fringe_fusion/pose/view.hpp"

namespace fringe_fusion::ros_io {

/// How far the pose from tf may be off. A turntable errs about and along the axes of `object`, an
/// arm about and along those of the camera that it carries.
struct PosePriorConfig {
  bool in_object_frame = true;
  std::array<double, 3> rotation_sigma_deg{{0.02, 0.02, 0.05}};
  std::array<double, 3> translation_sigma_mm{{0.2, 0.2, 0.2}};

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("in_object_frame", in_object_frame);
    field("rotation_sigma_deg", rotation_sigma_deg, 1e-6, 180.0);
    field("translation_sigma_mm", translation_sigma_mm, 1e-6, 1e6);
  }
};

/// A device pose with the covariance of its right perturbation.
[[nodiscard]] Pose PriorPose(const Transform& T_object_camera, const PosePriorConfig& config,
                             PoseSource source);

}  // namespace fringe_fusion::ros_io
