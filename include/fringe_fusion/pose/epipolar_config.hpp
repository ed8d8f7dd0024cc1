#pragma once

#include <string>

#include "fringe_fusion/common/config.hpp"

namespace fringe_fusion {

/// Settings of everything that follows from the epipolar constraint. File: config/epipolar.yaml.
struct EpipolarConfig {
  int max_matches = 10000;  ///< of one view; a phase map is sampled on a grid to stay below
  int min_matches = 50;     ///< fewer say nothing reliable
  /// Residual that is minimised: "one_sided" (exact, weighted) or "symmetric" (distance of both
  /// points to their epipolar lines, unweighted; for comparison).
  std::string objective = "one_sided";
  double huber_sigma = 2.5;              ///< residuals beyond this many deviations count linearly
  double min_spread_ratio = 0.002;       ///< least rms width of the matches, of the image diagonal
  double min_inlier_ratio = 0.5;         ///< of matches that fit the pose within 3 deviations
  double min_cheirality_ratio = 0.9;     ///< of inliers that lie before both devices
  double max_residual_px = 3.0;          ///< largest median distance to the epipolar line
  double max_direction_sigma_deg = 5.0;  ///< of the baseline's direction, else nothing is known
  double max_condition = 1e8;            ///< of the normal equations, scaled to unit diagonal
  double min_ambiguity_chi2 = 25.0;      ///< by which the other pose of a plane must fit worse
  double max_focal_sigma_ratio = 0.02;   ///< self-calibration: of a focal length that is told

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("max_matches", max_matches, 50, 10000000);
    field("min_matches", min_matches, 8, 1000000);
    field("objective", objective);
    field("huber_sigma", huber_sigma, 0.5, 1000.0);
    field("min_spread_ratio", min_spread_ratio, 0.0, 0.5);
    field("min_inlier_ratio", min_inlier_ratio, 0.0, 1.0);
    field("min_cheirality_ratio", min_cheirality_ratio, 0.5, 1.0);
    field("max_residual_px", max_residual_px, 0.001, 1000.0);
    field("max_direction_sigma_deg", max_direction_sigma_deg, 1e-6, 90.0);
    field("max_condition", max_condition, 1.0, 1e15);
    field("min_ambiguity_chi2", min_ambiguity_chi2, 0.0, 1e6);
    field("max_focal_sigma_ratio", max_focal_sigma_ratio, 1e-6, 1.0);
  }
};

/// Checks the bounds and the name of the objective.
[[nodiscard]] Status Validate(const EpipolarConfig& config);

}  // namespace fringe_fusion
