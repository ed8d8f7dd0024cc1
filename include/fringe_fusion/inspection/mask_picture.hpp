#pragma once

#include <cstdint>

#include "fringe_fusion/common/image.hpp"
#include "fringe_fusion/phase/phase_map.hpp"

namespace fringe_fusion {

/// Colour of a reason in pictures: white for valid pixels, dark ones where there was no light, a
/// different one for each reason; magenta outside the enumeration.
[[nodiscard]] Rgb8 MaskColor(MaskReason reason);

/// A mask in the colours of its reasons.
[[nodiscard]] Image<Rgb8> RenderMask(const Image<std::uint8_t>& mask);

/// Colour, number in mask.png and name of every reason, one below the other.
[[nodiscard]] Image<Rgb8> MaskLegend();

}  // namespace fringe_fusion
