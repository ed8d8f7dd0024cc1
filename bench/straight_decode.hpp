#pragma once

#include <array>
#include <opencv2/core.hpp>

#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/phase/phase_map.hpp"

namespace fringe_fusion::bench {

/// What a straight implementation gives, in 32-bit floats; NaN where masked.
struct StraightMap {
  cv::Mat u, v, sigma_u, sigma_v, offset, modulation;
  cv::Mat mask;  ///< 8 bit, 255 where valid
};

/// The four steps of the finest set of u as 32-bit floats.
[[nodiscard]] std::array<cv::Mat, 4> FinestSteps(const ImageStack& stack);

/// The decode of DecodePhase as one writes it down with OpenCV, image by image: four-step phases,
/// nearest fringe orders from coarse to fine, inverse variances, contrast, modulation and order
/// masks. Without the edge mask, the residual test and the weights of shot noise within a set.
/// @param stack 8 bit, four even steps of every frequency of both axes, the coarsest one fringe.
[[nodiscard]] StraightMap DecodeStraight(const ImageStack& stack, const PhaseConfig& config);

}  // namespace fringe_fusion::bench
