#pragma once

#include <vector>

#include "fringe_fusion/capture/image_stack.hpp"

namespace fringe_fusion::diagnosis {

/// Grey values from this share of the full scale on may be saturated.
constexpr float kSaturationRatio = 0.98F;

/// Every stride-th pixel of every frame as float: enough for statistics, and small.
struct SampledStack {
  int stride = 1;
  float full_scale_dn = 255.0F;
  std::vector<Image<float>> frames;

  [[nodiscard]] int width() const { return frames.front().width(); }
  [[nodiscard]] int height() const { return frames.front().height(); }
  [[nodiscard]] std::size_t size() const { return frames.front().size(); }
};

/// Samples a stack on a grid of at most about `max_samples` pixels.
/// @param stack whose frames have one size; their number need not fit the sequence.
/// @return error when there is no frame or the frames differ in size.
[[nodiscard]] Result<SampledStack> SampleStack(const ImageStack& stack, int max_samples);

/// One N-step set: frame_of_step[n] is the frame of phase shift 2 pi n / N.
struct StepSet {
  Axis axis = Axis::kU;
  int size_px = 0;  ///< of the axis
  double fringes = 0.0;
  double sign = 1.0;
  double offset_rad = 0.0;
  std::vector<int> frame_of_step;
};

/// Frames of one Gray bit; -1 where the sequence has none.
struct GrayFrames {
  Axis axis = Axis::kU;
  int bit = 0;
  double cell_px = 1.0;
  double offset_px = 0.0;
  int frame = -1;
  int inverse_frame = -1;
};

/// A sequence sorted by what its frames are for. Frames of kinds it does not know are left out.
struct SequencePlan {
  std::vector<int> white_frames;
  std::vector<int> black_frames;
  std::vector<StepSet> sets;     ///< by axis, then rising number of fringes
  std::vector<GrayFrames> gray;  ///< by axis, then falling bit
};

/// Sorts a sequence; incomplete sets are left out.
[[nodiscard]] SequencePlan MakeSequencePlan(const PatternSequence& sequence);

/// I_n = A + B cos(phi - 2 pi n / N) per sample. Ref: science section 2.1.
struct StepFit {
  Image<float> offset_dn;      ///< A
  Image<float> modulation_dn;  ///< B
  Image<float> phase_rad;      ///< phi
};

[[nodiscard]] StepFit FitSteps(const SampledStack& stack, const StepSet& set);

/// Whether a set is the one with most, or fewest, fringes of its axis.
[[nodiscard]] bool IsFinest(const SequencePlan& plan, std::size_t set);
[[nodiscard]] bool IsCoarsest(const SequencePlan& plan, std::size_t set);

/// Projector coordinate of every sample by the finest set of an axis, unwrapped from a coarsest
/// of at most 1 fringe [px]. Samples without light carry some number.
/// @param fits one per set of the plan.
/// @return empty when the axis has no set, or nothing unwraps its coarsest.
/// Ref: science section 2.3 (hierarchical).
[[nodiscard]] Image<float> FineCoordinate(const SequencePlan& plan,
                                          const std::vector<StepFit>& fits, Axis axis);

/// Phase that a set has at projector coordinates.
[[nodiscard]] Image<float> PhaseAt(const StepSet& set, const Image<float>& coordinate);

/// Mean of some frames, pixel by pixel. @param frames at least one.
[[nodiscard]] Image<float> MeanOfFrames(const SampledStack& stack, const std::vector<int>& frames);

}  // namespace fringe_fusion::diagnosis
