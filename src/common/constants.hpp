#pragma once

#include <limits>

namespace fringe_fusion {

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kTwoPi = 2.0 * kPi;
inline constexpr double kRadPerDeg = kPi / 180.0;
inline constexpr double kDegPerRad = 180.0 / kPi;
inline constexpr double kBytesPerGb = 1e9;
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Marks what was not measured in images and points, which are float.
inline constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

}  // namespace fringe_fusion
