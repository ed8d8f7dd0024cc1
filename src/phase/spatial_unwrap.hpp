#pragma once

#include "gray_smoothing.hpp"

namespace fringe_fusion::decode {

/// Unwraps one frequency over the image: pixels are joined along the most reliable pairs first, so
/// that errors stay at the edges of surfaces. Every connected surface keeps an unknown multiple of
/// the period: the result is relative.
/// Reliability is the second difference of the phase; ties are broken by the position.
/// Ref: Herraez, Burton, Lalor, Gdeisat, "Fast two-dimensional phase-unwrapping algorithm based on
/// sorting by reliability following a noncontinuous path", Applied Optics 41(35), 2002.
/// @param wrapped coordinates within one period [projector px]; NaN where invalid.
[[nodiscard]] Image<float> UnwrapOverImage(const Image<float>& wrapped, double period_px);

}  // namespace fringe_fusion::decode
