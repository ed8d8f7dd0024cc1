#pragma once

#include <string>

#include "fringe_fusion/calibration/cell_calibration.hpp"

namespace fringe_fusion {

/// Size of a picture; 0 x 0: not stated.
struct PictureSize {
  int width = 0;
  int height = 0;
};

/// Reads a calibration that OpenCV's FileStorage wrote, YAML or XML, lengths in mm. Its keys tell
/// whose it is: sltk (cam_K, pro_K, R, T), slstudio (Kc, Kp, Rp, Tp) or procam-calibration
/// (cam_int, proj_int, roration, translation).
/// @param camera_size,projector_size for files that do not state them; where both do, they must
/// agree.
/// @return error naming file, key, value and bound, or the size that is missing.
[[nodiscard]] Result<CellCalibration> ReadOpenCvCalibration(const std::string& path,
                                                            const PictureSize& camera_size = {},
                                                            const PictureSize& projector_size = {});

}  // namespace fringe_fusion
