#pragma once

#include <string>
#include <vector>

#include "fringe_fusion/calibration/calibrate_cell.hpp"

namespace fringe_fusion {

/// Settings of a re-calibration from one view. File: config/drift.yaml. How far a cell may have
/// moved since it was calibrated, standard deviations; the distortion is taken as it was.
struct DriftConfig {
  double sigma_rotation_deg = 0.05;    ///< of the projector against the camera, each axis
  double sigma_translation_mm = 0.2;   ///< likewise
  double sigma_focal_ratio = 5e-4;     ///< of a focal length, by temperature or a lens ring
  double sigma_principal_px = 1.0;     ///< of a principal point, each axis
  int min_points = 20;                 ///< seen by both devices
  double min_information_ratio = 1.0;  ///< of the view over what was known: less is no news
  double huber_sigma = 3.0;            ///< points beyond count linearly
  double max_rms_px = 1.0;             ///< after the update: beyond, the view is not of this cell
  double max_moved_sigma = 6.0;        ///< an update beyond what may have moved is refused
  double max_chi2_ratio = 3.0;         ///< change over its expected noise: beyond, it has moved

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("sigma_rotation_deg", sigma_rotation_deg, 1e-6, 10.0);
    field("sigma_translation_mm", sigma_translation_mm, 1e-6, 1000.0);
    field("sigma_focal_ratio", sigma_focal_ratio, 1e-8, 0.1);
    field("sigma_principal_px", sigma_principal_px, 1e-6, 1000.0);
    field("min_points", min_points, 8, 1000000);
    field("min_information_ratio", min_information_ratio, 1e-3, 1e6);
    field("huber_sigma", huber_sigma, 1.0, 1000.0);
    field("max_rms_px", max_rms_px, 1e-3, 1e3);
    field("max_moved_sigma", max_moved_sigma, 1.0, 1e6);
    field("max_chi2_ratio", max_chi2_ratio, 1.0, 1e6);
  }
};

using CellVector = Eigen::Matrix<double, kNumCellParameters, 1>;

/// What one view said about a cell that was calibrated before.
struct DriftResult {
  CellCalibration calibration;  ///< only what the view tells is changed
  CellCovariance covariance = CellCovariance::Zero();
  CellVector change = CellVector::Zero();        ///< in the order of CellParameterName
  CellVector sigma_change = CellVector::Zero();  ///< of the change; 0: was not touched
  int num_observed = 0;                          ///< directions that the view tells
  std::vector<std::string> observed;             ///< each in words, the best told first
  bool has_moved = false;                        ///< the change is more than noise
  double chi2_ratio = 0.0;                       ///< of the change, 1 is expected without any
  double rms_before_px = 0.0;                    ///< joint, the pose of the target fitted
  double rms_after_px = 0.0;
  std::string words;
};

/// Updates a calibration by one sighting of a target: the earlier calibration with its covariance
/// and what may have moved is the prior, and only directions of the parameters of which the view
/// tells more than the prior (`min_information_ratio`) are changed.
/// @param covariance of the earlier calibration; zero where it is not known.
/// @return error for a sighting with too few points or of another target, for a residual that says
/// that this is not the cell, and for an update beyond what may have moved.
[[nodiscard]] Result<DriftResult> UpdateCell(const CellCalibration& before,
                                             const CellCovariance& covariance,
                                             const CalibrationTarget& target,
                                             const TargetSighting& sighting,
                                             const DriftConfig& config);

}  // namespace fringe_fusion
