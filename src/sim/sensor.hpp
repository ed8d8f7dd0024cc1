#pragma once

#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"
#include "random.hpp"

namespace fringe_fusion::sim {

/// Grey values of a radiance image: gain to full scale, shot and read noise, saturation at both
/// ends, rounding to whole grey values.
/// @param radiance 1 for a frontal white surface under a white projector.
/// @param exposure exposure time over the reference exposure time.
[[nodiscard]] FramePixels Expose(const SimConfig& config, const Image<float>& radiance,
                                 double exposure, const RandomStream& noise);

}  // namespace fringe_fusion::sim
