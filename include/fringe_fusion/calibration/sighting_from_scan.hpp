#pragma once

#include "fringe_fusion/calibration/detect_target.hpp"
#include "fringe_fusion/calibration/transfer_target.hpp"
#include "fringe_fusion/io/scan_folder.hpp"

namespace fringe_fusion {

/// Settings of the stages from frames to a sighting.
struct SightingConfig {
  PhaseConfig phase;
  DetectConfig detect;
  TransferConfig transfer;
};

/// Decodes the frames of one pose of a target, finds the target in their mean picture and gives its
/// points projector coordinates.
/// @param name of the sighting, also heads every message.
[[nodiscard]] Result<TargetSighting> SightTarget(const ImageStack& stack,
                                                 const CalibrationTarget& target,
                                                 const SightingConfig& config,
                                                 const std::string& name);

/// SightTarget on one view of a scan folder; the calibration of the folder is not used.
/// @return error naming the view.
[[nodiscard]] Result<TargetSighting> ReadCalibrationPose(const ScanFolder& scan, int view_id,
                                                         const CalibrationTarget& target,
                                                         const SightingConfig& config);

/// The picture in which the target is looked for: frames whose patterns even out are averaged
/// (whole phase sets, Gray bits with their inverses), else the white frame is taken.
/// @return error when the stack has neither.
[[nodiscard]] Result<Image<float>> EvenlyLitPicture(const ImageStack& stack);

}  // namespace fringe_fusion
