#pragma once

#include <cstddef>

namespace fringe_fusion {

/// Numbers of views and points are int, subscripts are not.
constexpr std::size_t At(int i) { return static_cast<std::size_t>(i); }

}  // namespace fringe_fusion
