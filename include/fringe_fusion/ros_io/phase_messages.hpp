#pragma once

#include <fringe_fusion/DecodedView.h>

#include <string>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/phase/phase_map.hpp"

namespace fringe_fusion::ros_io {

/// Codes of one view with all that is needed to judge them.
struct DecodedCodes {
  std::string scan_id;
  int view_id = 0;
  std::string camera_frame;
  std::string projector_frame;
  PhaseMap phase;  ///< codes and sigmas alone: no mask, grey values or colour; NaN where invalid
  CellCalibration calibration;  ///< without serials
};

/// @param phase may lack an axis. @param codes everything else; its `phase` is not looked at.
[[nodiscard]] DecodedView ToMessage(const PhaseMap& phase, const DecodedCodes& codes);

/// @return error naming scan and view when a picture, a model or the pose is malformed, or sizes do
/// not fit each other.
[[nodiscard]] Result<DecodedCodes> FromMessage(const DecodedView& message);

}  // namespace fringe_fusion::ros_io
