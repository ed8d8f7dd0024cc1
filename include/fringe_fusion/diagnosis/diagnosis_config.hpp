#pragma once

#include "fringe_fusion/common/config.hpp"

namespace fringe_fusion {

/// When a stack counts as faulty. A limit says from where on the fault costs accuracy or points;
/// docs/diagnosis.md tells what each value is and how the limits were chosen.
struct DiagnosisConfig {
  bool estimate_noise = false;          ///< sensor noise from each scan itself, not from phase.yaml
  int max_samples = 60000;              ///< pixels that are looked at
  double max_saturated_ratio = 0.02;    ///< share of the lit pixels that saturate
  double min_light_ratio = 0.12;        ///< median of white minus black [of full scale]
  double max_gamma_error = 0.1;         ///< distance of the response's gamma from 1
  double max_gain_ratio = 0.006;        ///< variation of the projector's light between frames, rms
  double max_flicker_ratio = 0.004;     ///< variation of the other light [of the projector's], rms
  double max_motion_px = 0.02;          ///< shift of edges between frames, rms [camera px]
  double max_motion_rad = 0.01;         ///< shift of the finest fringes between frames, rms
  double max_scale_error_ratio = 0.01;  ///< distance of the projected picture's scale from 1
  double max_camera_blur_px = 1.3;      ///< blur of the sharper edges, sigma [camera px]
  double min_fine_contrast = 0.5;       ///< amplitude of the finest over the coarsest fringes
  double max_indirect_rad = 0.008;  ///< error of the coarsest phase over parts of the image, rms

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("estimate_noise", estimate_noise);
    field("max_samples", max_samples, 1000, 10000000);
    field("max_saturated_ratio", max_saturated_ratio, 0.0, 1.0);
    field("min_light_ratio", min_light_ratio, 0.0, 1.0);
    field("max_gamma_error", max_gamma_error, 0.0, 10.0);
    field("max_gain_ratio", max_gain_ratio, 0.0, 1.0);
    field("max_flicker_ratio", max_flicker_ratio, 0.0, 1.0);
    field("max_motion_px", max_motion_px, 0.0, 100.0);
    field("max_motion_rad", max_motion_rad, 0.0, 10.0);
    field("max_scale_error_ratio", max_scale_error_ratio, 0.0, 1.0);
    field("max_camera_blur_px", max_camera_blur_px, 0.0, 100.0);
    field("min_fine_contrast", min_fine_contrast, 0.0, 1.0);
    field("max_indirect_rad", max_indirect_rad, 0.0, 10.0);
  }
};

}  // namespace fringe_fusion
