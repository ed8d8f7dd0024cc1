#pragma once

#include "fringe_fusion/calibration/target.hpp"
#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/image.hpp"

namespace fringe_fusion {

/// Settings of DetectTarget. Sensor noise as in PhaseConfig weighs the pixels; the stated
/// covariances are scaled by the residuals of each fit.
struct DetectConfig {
  double read_noise_dn = 1.0;
  double gain_dn = 0.05;
  double min_contrast_ratio = 0.15;  ///< least (light - dark) / light across an edge of the print
  double min_dot_radius_px = 2.5;    ///< of the larger axis
  double max_dot_radius_px = 200.0;  ///< of the larger axis
  double max_aspect_ratio = 4.0;     ///< of the imaged dots: tilt up to 75 degrees
  double max_residual_ratio = 0.12;  ///< rms of a fitted dot or corner over its contrast
  double min_points_ratio = 0.4;     ///< share of the target's points that must be found

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("read_noise_dn", read_noise_dn, 0.0, 1000.0);
    field("gain_dn", gain_dn, 0.0, 1000.0);
    field("min_contrast_ratio", min_contrast_ratio, 0.01, 1.0);
    field("min_dot_radius_px", min_dot_radius_px, 1.5, 1000.0);
    field("max_dot_radius_px", max_dot_radius_px, 2.0, 10000.0);
    field("max_aspect_ratio", max_aspect_ratio, 1.0, 20.0);
    field("max_residual_ratio", max_residual_ratio, 0.001, 1.0);
    field("min_points_ratio", min_points_ratio, 0.01, 1.0);
  }
};

/// Finds a target in a picture: corners as the saddle where two edges cross, dots as the centre of
/// the imaged ellipse (`is_ellipse_centre`), both by a least-squares fit of the blurred print to
/// the grey values, so that the variance is that of the bound; each point carries its covariance.
/// Partial views are taken where markers or marked dots tell which part is seen.
/// @param picture grey values [DN], evenly lit.
/// @return error that tells what is seen instead: nothing, another number of columns and rows, a
/// mirrored print, too small a part, or a part that may lie anywhere on the target.
/// Ref: science section 1.2.
[[nodiscard]] Result<TargetSighting> DetectTarget(const Image<float>& picture,
                                                  const CalibrationTarget& target,
                                                  const DetectConfig& config);

/// Grey values of a frame as DetectTarget takes them.
[[nodiscard]] Image<float> GreyPicture(const FramePixels& pixels);

}  // namespace fringe_fusion
