#pragma once

#include <optional>

#include "fringe_fusion/calibration/target.hpp"
#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/geometry/camera_model.hpp"
#include "fringe_fusion/phase/phase_map.hpp"

namespace fringe_fusion {

/// Settings of TransferToProjector.
struct TransferConfig {
  double window_ratio = 0.45;       ///< radius of the fit over the distance of the points
  double max_window_px = 40.0;      ///< and at most this [camera px]
  double edge_guard_px = 3.5;       ///< pixels closer to an edge of the print mix two phases
  double max_residual_sigma = 4.0;  ///< a pixel farther from the fit is left out
  int min_pixels = 24;              ///< least number of pixels of a fit
  double max_sigma_px = 0.5;        ///< largest standard deviation of the result [projector px]

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("window_ratio", window_ratio, 0.05, 1.0);
    field("max_window_px", max_window_px, 3.0, 1000.0);
    field("edge_guard_px", edge_guard_px, 0.0, 100.0);
    field("max_residual_sigma", max_residual_sigma, 1.0, 1000.0);
    field("min_pixels", min_pixels, 7, 100000);
    field("max_sigma_px", max_sigma_px, 1e-6, 1000.0);
  }
};

/// Projector coordinates of the true centres of a sighting's points: around each point a weighted
/// polynomial of second degree is fitted to the decoded coordinates of the pixels that lie clear of
/// every edge of the print, and evaluated at the true centre. Points without enough good pixels
/// keep has_projector = false.
/// @param camera undistorts the pixels of the fit if given; without it the fit is in raw pixels.
/// @return the sighting with projector coordinates and covariances; error when the map does not
/// have both axes, is relative, or serves no point at all.
/// Ref: science section 1.4.
[[nodiscard]] Result<TargetSighting> TransferToProjector(const PhaseMap& phase,
                                                         const TargetSighting& sighting,
                                                         const CalibrationTarget& target,
                                                         const TransferConfig& config,
                                                         const std::optional<CameraModel>& camera);

/// Pixel of the true centre of every point of a sighting: that of the sighting for corners; for
/// dots less the shift of the ellipse centre that the perspective of the whole target predicts.
[[nodiscard]] std::vector<Eigen::Vector2d> TrueCentres(const TargetSighting& sighting,
                                                       const CalibrationTarget& target);

}  // namespace fringe_fusion
