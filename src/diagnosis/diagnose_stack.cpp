#include "fringe_fusion/diagnosis/diagnose_stack.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>

#include "exposures.hpp"
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
  const std::set<double> exposures = diagnosis::ExposuresOf(whole);
  const auto shortest = diagnosis::FramesOf(*all, whole.sequence, *exposures.begin());
  const auto longest = diagnosis::FramesOf(*all, whole.sequence, *exposures.rbegin());
  const double light = diagnosis::MedianLight(longest, diagnosis::FindLightRange(longest, phase));
  const bool dark = !(light >= config.min_light_ratio);

  Findings findings;
  const bool complete = whole.frames.size() == whole.sequence.frames.size();
  // Frames are many megabytes: they are copied only where some are left out.
  const bool is_one = diagnosis::IsOneExposure(whole.sequence);
  const ImageStack part =
      is_one ? ImageStack()
             : diagnosis::OneExposure(whole, diagnosis::BestExposure(*all, whole, phase));
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
