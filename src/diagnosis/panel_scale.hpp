#pragma once

#include <vector>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "stack_sampling.hpp"

namespace fringe_fusion::diagnosis {

/// A camera pixel and the projector coordinates that the code gives it [px].
struct CodedPixel {
  double x = 0.0;
  double y = 0.0;
  double u = 0.0;
  double v = 0.0;
};

/// Scale of the shown pictures about their upper left corner that brings the coordinates onto the
/// epipolar lines of the calibration: a panel that is driven with another resolution scales them.
struct PanelScale {
  double scale = 1.0;        ///< panel pixels per picture pixel
  double distance_px = 0.0;  ///< median distance to the epipolar lines as it is [projector px]
  double scaled_px = 0.0;    ///< the same after scaling
};
[[nodiscard]] PanelScale FitPanelScale(const std::vector<CodedPixel>& pixels,
                                       const CellCalibration& calibration);

}  // namespace fringe_fusion::diagnosis
