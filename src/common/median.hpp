#pragma once

#include <vector>

namespace fringe_fusion {

/// Median of values; of an even number the upper one of the two in the middle.
/// @param values not empty.
[[nodiscard]] double Median(std::vector<double> values);

}  // namespace fringe_fusion
