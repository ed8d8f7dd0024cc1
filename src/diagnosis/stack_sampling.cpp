#include "stack_sampling.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "common/constants.hpp"

namespace fringe_fusion::diagnosis {
namespace {

Image<float> SampleFrame(const CapturedFrame& frame, int stride) {
  return std::visit(
      [&](const auto& pixels) {
        Image<float> samples((pixels.width() - 1) / stride + 1, (pixels.height() - 1) / stride + 1);
        for (int y = 0; y < samples.height(); ++y) {
          for (int x = 0; x < samples.width(); ++x) {
            samples(x, y) = static_cast<float>(pixels(x * stride, y * stride));
          }
        }
        return samples;
      },
      frame.pixels);
}

void AddStep(const Pattern& pattern, int frame, int size_px, std::vector<StepSet>& sets) {
  const auto step = static_cast<std::size_t>(pattern.step);
  const auto open = [&](const StepSet& set) {
    return set.axis == pattern.axis && set.fringes == pattern.fringes &&
           set.frame_of_step.size() == static_cast<std::size_t>(pattern.steps) &&
           set.sign == pattern.phase_sign && set.offset_rad == pattern.phase_offset_rad &&
           set.frame_of_step[step] < 0;
  };
  auto set = std::find_if(sets.begin(), sets.end(), open);
  if (set == sets.end()) {
    StepSet fresh;
    fresh.axis = pattern.axis;
    fresh.size_px = size_px;
    fresh.fringes = pattern.fringes;
    fresh.sign = pattern.phase_sign;
    fresh.offset_rad = pattern.phase_offset_rad;
    fresh.frame_of_step.assign(static_cast<std::size_t>(pattern.steps), -1);
    set = sets.insert(sets.end(), fresh);
  }
  set->frame_of_step[step] = frame;
}

void AddGray(const Pattern& pattern, int frame, std::vector<GrayFrames>& gray) {
  auto bit = std::find_if(gray.begin(), gray.end(), [&](const GrayFrames& g) {
    return g.axis == pattern.axis && g.bit == pattern.bit;
  });
  if (bit == gray.end()) {
    bit = gray.insert(gray.end(),
                      {pattern.axis, pattern.bit, pattern.cell_px, pattern.offset_px, -1, -1});
  }
  (pattern.inverse ? bit->inverse_frame : bit->frame) = frame;
}

}  // namespace

Result<SampledStack> SampleStack(const ImageStack& stack, int max_samples) {
  if (stack.frames.empty()) return Fail("diagnosis: the stack has no frames");
  const int width = Width(stack.frames.front());
  const int height = Height(stack.frames.front());
  if (width < 1 || height < 1) return Fail("diagnosis: frame 0 is {} x {}", width, height);
  SampledStack sampled;
  sampled.full_scale_dn =
      static_cast<float>((1 << std::clamp(stack.frames.front().bit_depth, 1, 16)) - 1);
  const double pixels = static_cast<double>(width) * height;
  sampled.stride = std::max(1, static_cast<int>(std::ceil(std::sqrt(pixels / max_samples))));
  for (std::size_t i = 0; i < stack.frames.size(); ++i) {
    const CapturedFrame& frame = stack.frames[i];
    if (Width(frame) != width || Height(frame) != height) {
      return Fail("diagnosis: frame {} is {} x {}, but frame 0 is {} x {}", i, Width(frame),
                  Height(frame), width, height);
    }
    sampled.frames.push_back(SampleFrame(frame, sampled.stride));
  }
  return sampled;
}

SequencePlan MakeSequencePlan(const PatternSequence& sequence) {
  SequencePlan plan;
  for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
    const Pattern& pattern = sequence.frames[i];
    const auto frame = static_cast<int>(i);
    if (pattern.kind == PatternKind::kWhite) plan.white_frames.push_back(frame);
    if (pattern.kind == PatternKind::kBlack) plan.black_frames.push_back(frame);
    if (pattern.kind == PatternKind::kGray) AddGray(pattern, frame, plan.gray);
    if (pattern.kind == PatternKind::kPhase && pattern.step >= 0 && pattern.step < pattern.steps) {
      AddStep(pattern, frame, pattern.axis == Axis::kU ? sequence.width : sequence.height,
              plan.sets);
    }
  }
  const auto incomplete = [](const StepSet& set) {
    return set.frame_of_step.size() < 3 ||
           std::count(set.frame_of_step.begin(), set.frame_of_step.end(), -1) > 0;
  };
  plan.sets.erase(std::remove_if(plan.sets.begin(), plan.sets.end(), incomplete), plan.sets.end());
  std::stable_sort(plan.sets.begin(), plan.sets.end(), [](const StepSet& a, const StepSet& b) {
    return a.axis != b.axis ? a.axis < b.axis : a.fringes < b.fringes;
  });
  std::stable_sort(plan.gray.begin(), plan.gray.end(),
                   [](const GrayFrames& a, const GrayFrames& b) {
                     return a.axis != b.axis ? a.axis < b.axis : a.bit > b.bit;
                   });
  return plan;
}

StepFit FitSteps(const SampledStack& stack, const StepSet& set) {
  const std::size_t steps = set.frame_of_step.size();
  const int width = stack.width();
  const int height = stack.height();
  StepFit fit{Image<float>(width, height), Image<float>(width, height),
              Image<float>(width, height)};
  Image<float> sine(width, height);
  Image<float> cosine(width, height);
  for (std::size_t n = 0; n < steps; ++n) {
    const Image<float>& frame = stack.frames[static_cast<std::size_t>(set.frame_of_step[n])];
    const double delta = kTwoPi * static_cast<double>(n) / static_cast<double>(steps);
    const auto sin_delta = static_cast<float>(std::sin(delta));
    const auto cos_delta = static_cast<float>(std::cos(delta));
    for (std::size_t i = 0; i < frame.size(); ++i) {
      fit.offset_dn[i] += frame[i];
      sine[i] += frame[i] * sin_delta;
      cosine[i] += frame[i] * cos_delta;
    }
  }
  const auto count = static_cast<float>(steps);
  for (std::size_t i = 0; i < sine.size(); ++i) {
    fit.offset_dn[i] /= count;
    fit.modulation_dn[i] = 2.0F / count * std::hypot(sine[i], cosine[i]);
    fit.phase_rad[i] = std::atan2(sine[i], cosine[i]);
  }
  return fit;
}

bool IsFinest(const SequencePlan& plan, std::size_t set) {
  return set + 1 == plan.sets.size() || plan.sets[set + 1].axis != plan.sets[set].axis;
}

bool IsCoarsest(const SequencePlan& plan, std::size_t set) {
  return set == 0 || plan.sets[set - 1].axis != plan.sets[set].axis;
}

Image<float> FineCoordinate(const SequencePlan& plan, const std::vector<StepFit>& fits, Axis axis) {
  Image<float> coordinate;
  for (std::size_t s = 0; s < plan.sets.size(); ++s) {
    const StepSet& set = plan.sets[s];
    if (set.axis != axis) continue;
    if (IsCoarsest(plan, s)) {
      if (!(set.fringes <= 1.0)) return {};
      // The middle of the projector, so that the nearest order is the only one.
      const auto middle = static_cast<float>(0.5 * set.size_px - 0.5);
      coordinate = Image<float>(fits[s].phase_rad.width(), fits[s].phase_rad.height(), middle);
    }
    const double period_px = set.size_px / set.fringes;
    for (std::size_t i = 0; i < coordinate.size(); ++i) {
      const double phase = set.sign * static_cast<double>(fits[s].phase_rad[i]) - set.offset_rad;
      const double wrapped_px = period_px * phase / kTwoPi - 0.5;
      const double order =
          std::round((static_cast<double>(coordinate[i]) - wrapped_px) / period_px);
      coordinate[i] = static_cast<float>(wrapped_px + order * period_px);
    }
  }
  return coordinate;
}

Image<float> PhaseAt(const StepSet& set, const Image<float>& coordinate) {
  Image<float> phase(coordinate.width(), coordinate.height());
  for (std::size_t i = 0; i < phase.size(); ++i) {
    const double rad =
        kTwoPi * set.fringes * (static_cast<double>(coordinate[i]) + 0.5) / set.size_px;
    phase[i] = static_cast<float>(std::remainder(set.sign * (rad + set.offset_rad), kTwoPi));
  }
  return phase;
}

Image<float> MeanOfFrames(const SampledStack& stack, const std::vector<int>& frames) {
  Image<float> mean(stack.width(), stack.height());
  for (const int frame : frames) {
    const Image<float>& values = stack.frames[static_cast<std::size_t>(frame)];
    for (std::size_t i = 0; i < mean.size(); ++i) mean[i] += values[i];
  }
  for (float& value : mean) value /= static_cast<float>(frames.size());
  return mean;
}

}  // namespace fringe_fusion::diagnosis
