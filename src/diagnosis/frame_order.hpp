#pragma once

#include <string>
#include <vector>

#include "fringe_fusion/pattern/pattern_sequence.hpp"
#include "lit_pixels.hpp"

namespace fringe_fusion::diagnosis {

/// Which pattern each captured frame shows, found by comparing every frame with every pattern.
struct FrameOrder {
  std::vector<int> shown;        ///< pattern of frame i; -1: one of the sequence is not seen in it
  std::vector<double> mismatch;  ///< mean distance of frame i from pattern i [of the light]
  std::string skipped;           ///< why nothing could be compared; else empty
  std::vector<std::size_t> pixels;  ///< samples that were compared
  std::vector<double> u_px;         ///< their coordinates, to a part of a fringe; NaN: not coded
  std::vector<double> v_px;
};

/// Codes of one coordinate per axis alone can be compared: white, black, Gray, phase, micro.
///
/// Every pixel's coordinates are those that agree best with all frames under a hypothesis: frames
/// as planned, all late or early, or late or early from one frame on. The hypothesis of least
/// distance gives the coordinates, and these the light that each pattern would send to each pixel.
/// The loss saturates, so that single frames out of place do not move the coordinates.
/// @param frames of `stack` and patterns of `sequence` that were taken with one exposure, rising.
/// There may be fewer frames than patterns.
[[nodiscard]] FrameOrder FindFrameOrder(const SampledStack& stack, const PatternSequence& sequence,
                                        const LightRange& range);

}  // namespace fringe_fusion::diagnosis
