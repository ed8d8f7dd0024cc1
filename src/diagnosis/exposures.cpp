#include "exposures.hpp"

#include <algorithm>
#include <cstddef>

#include "lit_pixels.hpp"

namespace fringe_fusion::diagnosis {

bool IsOneExposure(const PatternSequence& sequence) {
  return std::all_of(sequence.frames.begin(), sequence.frames.end(), [&](const Pattern& pattern) {
    return pattern.exposure_ratio == sequence.frames.front().exposure_ratio &&
           pattern.carrier_steps == 0;
  });
}

std::set<double> ExposuresOf(const ImageStack& stack) {
  std::set<double> exposures;
  for (const Pattern& pattern : stack.sequence.frames) exposures.insert(pattern.exposure_ratio);
  return exposures;
}

ImageStack OneExposure(const ImageStack& stack, double exposure_ratio) {
  ImageStack part;
  part.sequence.width = stack.sequence.width;
  part.sequence.height = stack.sequence.height;
  for (std::size_t i = 0; i < stack.frames.size(); ++i) {
    const Pattern& pattern = stack.sequence.frames[i];
    if (pattern.exposure_ratio != exposure_ratio || pattern.carrier_steps > 0) continue;
    part.sequence.frames.push_back(pattern);
    part.frames.push_back(stack.frames[i]);
  }
  if (part.frames.empty()) {
    part.sequence.frames.push_back(stack.sequence.frames.front());
    part.frames.push_back(stack.frames.front());
  }
  return part;
}

SampledStack FramesOf(const SampledStack& sampled, const PatternSequence& sequence,
                      double exposure_ratio) {
  SampledStack part{sampled.stride, sampled.full_scale_dn, {}};
  for (std::size_t i = 0; i < sampled.frames.size(); ++i) {
    if (sequence.frames[i].exposure_ratio == exposure_ratio) {
      part.frames.push_back(sampled.frames[i]);
    }
  }
  // Frames may be missing.
  return part.frames.empty() ? sampled : part;
}

double BestExposure(const SampledStack& sampled, const ImageStack& stack,
                    const PhaseConfig& phase) {
  const std::set<double> exposures = ExposuresOf(stack);
  double best = *exposures.begin();
  int most = -1;
  for (const double exposure : exposures) {
    const SampledStack part = FramesOf(sampled, stack.sequence, exposure);
    const LightRange range = FindLightRange(part, phase);
    int usable = 0;
    for (std::size_t i = 0; i < part.size(); ++i) {
      const bool clipped = static_cast<double>(range.bright[i]) >=
                           phase.saturation_ratio * static_cast<double>(part.full_scale_dn);
      if (range.lit[i] != 0 && !clipped) ++usable;
    }
    if (usable > most) {
      most = usable;
      best = exposure;
    }
  }
  return best;
}

}  // namespace fringe_fusion::diagnosis
