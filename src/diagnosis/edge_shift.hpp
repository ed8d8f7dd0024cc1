#pragma once

#include "fringe_fusion/capture/image_stack.hpp"
#include "lit_pixels.hpp"
#include "stack_sampling.hpp"

namespace fringe_fusion::diagnosis {

/// How far the picture moves from frame to frame, seen at outlines, texture and shadows.
struct EdgeShift {
  double rms_px = 0.0;    ///< per axis of the camera's picture
  double sigma_px = 0.0;  ///< its standard deviation by the scatter of the pixels
  int num_edges = 0;
};

/// Mean of all phase frames, in which fringes cancel; of the white frames where there are none.
[[nodiscard]] Image<float> MeanImage(const ImageStack& stack, const SequencePlan& plan);

/// A picture that moves by t in frame n changes by -grad A . t there. The second Fourier
/// coefficient over the N >= 4 steps of a set (else the difference of the mean levels of the sets)
/// is free of a still scene and regressed on the gradient of the mean image. Unlike steps of light
/// the gradient has both signs.
/// @param mean_image of MeanImage.
[[nodiscard]] EdgeShift MeasureEdgeShift(const SampledStack& stack, const SequencePlan& plan,
                                         const LightRange& range, const Image<float>& mean_image);

}  // namespace fringe_fusion::diagnosis
