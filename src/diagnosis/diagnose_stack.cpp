#include "fringe_fusion/diagnosis/diagnose_stack.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>

#include "findings.hpp"
#include "light_checks.hpp"
#include "lit_pixels.hpp"
#include "optics_checks.hpp"
#include "order_check.hpp"
#include "stack_sampling.hpp"
#include "time_checks.hpp"

namespace fringe_fusion {
namespace {

using diagnosis::Findings;

Status CheckInput(const ImageStack& stack, const DiagnosisConfig& config) {
  if (Status status = CheckBounds(config, "diagnosis"); !status) return status;
  if (Status status = Validate(stack.sequence, "diagnosis: patterns"); !status) return status;
  const std::size_t patterns = stack.sequence.frames.size();
  if (stack.frames.empty()) return Fail("diagnosis: the stack has no frames");
  if (stack.frames.size() > patterns) {
    return Fail("diagnosis: {} frames, but the sequence has {} patterns", stack.frames.size(),
                patterns);
  }
  if (stack.frames.size() == patterns) return Validate(stack, "diagnosis");
  // The frames that are there must fit each other; their number is judged later.
  ImageStack present = stack;
  present.sequence.frames.resize(stack.frames.size());
  return Validate(present, "diagnosis");
}

bool IsOneExposure(const PatternSequence& sequence) {
  return std::all_of(sequence.frames.begin(), sequence.frames.end(), [&](const Pattern& pattern) {
    return pattern.exposure_ratio == sequence.frames.front().exposure_ratio &&
           pattern.carrier_steps == 0;
  });
}

// Frames of one exposure, each of which codes one coordinate.
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
  // A sequence of carriers alone: one frame, by which every check is skipped.
  if (part.frames.empty()) {
    part.sequence.frames.push_back(stack.sequence.frames.front());
    part.frames.push_back(stack.frames.front());
  }
  return part;
}

std::set<double> ExposuresOf(const ImageStack& stack) {
  std::set<double> exposures;
  for (const Pattern& pattern : stack.sequence.frames) exposures.insert(pattern.exposure_ratio);
  return exposures;
}

// Samples of the frames of one exposure, of all kinds.
diagnosis::SampledStack FramesOf(const diagnosis::SampledStack& sampled,
                                 const PatternSequence& sequence, double exposure_ratio) {
  diagnosis::SampledStack part{sampled.stride, sampled.full_scale_dn, {}};
  for (std::size_t i = 0; i < sampled.frames.size(); ++i) {
    if (sequence.frames[i].exposure_ratio == exposure_ratio) {
      part.frames.push_back(sampled.frames[i]);
    }
  }
  // Frames may be missing.
  return part.frames.empty() ? sampled : part;
}

// The exposure that leaves most pixels lit and unsaturated.
double BestExposure(const diagnosis::SampledStack& sampled, const PatternSequence& sequence,
                    const std::set<double>& exposures, const PhaseConfig& phase) {
  double best = *exposures.begin();
  int most = -1;
  for (const double exposure : exposures) {
    const diagnosis::SampledStack part = FramesOf(sampled, sequence, exposure);
    const diagnosis::LightRange range = diagnosis::FindLightRange(part, phase);
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

void SkipFrom(FindingKind first, const std::string& why, Findings& findings) {
  for (int kind = static_cast<int>(first); kind < kNumFindingKinds; ++kind) {
    findings.Skip(static_cast<FindingKind>(kind), "not measured", why);
  }
}

Result<Diagnosis> Examine(const ImageStack& whole, const PhaseConfig& phase,
                          const DiagnosisConfig& config,
                          const std::optional<CellCalibration>& calibration) {
  const auto all = diagnosis::SampleStack(whole, config.max_samples);
  if (!all) return Forward(all);
  const std::set<double> exposures = ExposuresOf(whole);
  const auto shortest = FramesOf(*all, whole.sequence, *exposures.begin());
  const auto longest = FramesOf(*all, whole.sequence, *exposures.rbegin());
  const double light = diagnosis::MedianLight(longest, diagnosis::FindLightRange(longest, phase));
  const bool dark = !(light >= config.min_light_ratio);

  Findings findings;
  const bool complete = whole.frames.size() == whole.sequence.frames.size();
  // Frames are many megabytes: they are copied only where some are left out.
  const bool is_one = IsOneExposure(whole.sequence);
  const ImageStack part =
      is_one ? ImageStack()
             : OneExposure(whole, BestExposure(*all, whole.sequence, exposures, phase));
  const ImageStack& stack = is_one ? whole : part;
  const auto sampled = diagnosis::SampleStack(stack, config.max_samples);
  if (!sampled) return Forward(sampled);
  const diagnosis::FrameOrder order =
      diagnosis::CheckFrames(whole, stack, *sampled, phase, dark, findings);
  const bool ordered = !findings.Any();
  diagnosis::CheckLight(shortest, longest, phase, config, findings);
  if (!complete || !ordered) {
    SkipFrom(FindingKind::kResponse, "the frames are not those of the sequence", findings);
  } else if (dark) {
    SkipFrom(FindingKind::kResponse, "too little light", findings);
  } else {
    const diagnosis::SequencePlan plan = diagnosis::MakeSequencePlan(stack.sequence);
    const diagnosis::LightRange range = diagnosis::FindLightRange(*sampled, phase);
    const Image<float> mean = diagnosis::MeanImage(stack, plan);
    diagnosis::CheckTime(diagnosis::MeasureTime(*sampled, plan, range, mean), config, findings);
    diagnosis::CheckOptics({*sampled, plan, stack.sequence, range, mean, order, calibration},
                           config, findings);
  }
  return findings.Take();
}

}  // namespace

const char* FindingName(FindingKind kind) {
  constexpr std::array<const char*, kNumFindingKinds> kNames{
      "frames_dropped",   "frames_duplicated", "frames_shifted",    "frames_swapped", "saturation",
      "too_little_light", "response",          "exposure",          "flicker",        "motion",
      "resolution",       "camera_defocus",    "projector_defocus", "interreflection"};
  const auto index = static_cast<std::size_t>(kind);
  return index < kNames.size() ? kNames[index] : "unknown";
}

const char* CheckStateName(CheckState state) {
  if (state == CheckState::kSkipped) return "skipped";
  return state == CheckState::kPassed ? "passed" : "failed";
}

Result<Diagnosis> DiagnoseStack(const ImageStack& stack, const PhaseConfig& phase,
                                const DiagnosisConfig& config,
                                const std::optional<CellCalibration>& calibration) {
  if (const Status status = CheckInput(stack, config); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return Examine(stack, phase, config, calibration);
}

}  // namespace fringe_fusion
