#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "fringe_fusion/common/image.hpp"

namespace fringe_fusion::internal {

/// The modules of one marker of an OpenCV dictionary, border included: 0 black, 255 white.
[[nodiscard]] Image<std::uint8_t> MarkerModules(int dictionary, int id);

/// Number of markers of an OpenCV dictionary.
[[nodiscard]] int NumMarkers(int dictionary);

/// A marker found in a picture.
struct FoundMarker {
  int id = 0;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< mean of its corners [px]
};

/// Looks for markers of a dictionary. @param picture 0 to 255.
[[nodiscard]] std::vector<FoundMarker> FindMarkers(const Image<std::uint8_t>& picture,
                                                   int dictionary);

}  // namespace fringe_fusion::internal
