#include "fringe_fusion/diagnosis/diagnose_stack.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <type_traits>
#include <variant>

#include "findings.hpp"
#include "light_checks.hpp"
#include "lit_pixels.hpp"
#include "stack_sampling.hpp"

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
  // The frames that are there must fit each other; their number is judged later.
  ImageStack present = stack;
  present.sequence.frames.resize(stack.frames.size());
  return Validate(present, "diagnosis");
}

void CheckFrameCount(const ImageStack& stack, Findings& findings) {
  const std::size_t patterns = stack.sequence.frames.size();
  const auto missing = static_cast<double>(patterns - stack.frames.size());
  if (findings.Measure(FindingKind::kFramesDropped, "frames that are missing", missing, 0.0, "")) {
    return;
  }
  findings.Explain(
      fmt::format("{} frames came for {} patterns, limit 0 missing", stack.frames.size(), patterns),
      "take the scan again; if it recurs, lower the frame rate or give the camera's link more "
      "bandwidth (packet size, receive buffers)");
}

// Two frames of a sensor with noise are never the same.
void CheckSameFrames(const ImageStack& stack, Findings& findings) {
  int repeated = 0;
  std::size_t where = 0;
  for (std::size_t i = 1; i < stack.frames.size(); ++i) {
    const auto same = [&](const auto& pixels) {
      const auto& before = std::get<std::decay_t<decltype(pixels)>>(stack.frames[i - 1].pixels);
      const auto [low, high] = std::minmax_element(pixels.begin(), pixels.end());
      return *low != *high && std::equal(pixels.begin(), pixels.end(), before.begin());
    };
    if (!std::visit(same, stack.frames[i].pixels)) continue;
    if (++repeated == 1) where = i;
  }
  if (findings.Measure(FindingKind::kFramesDuplicated, "frames that repeat the one before",
                       repeated, 0.0, "")) {
    return;
  }
  findings.Explain(
      fmt::format("{} frames have the very pixels of the frame before (first: frame {}), limit 0",
                  repeated, where),
      "take the scan again; if it recurs, make the camera driver wait for a fresh frame");
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
                                const std::optional<CellCalibration>& /*calibration*/) {
  if (const Status status = CheckInput(stack, config); !status) {
    return tl::unexpected<Error>(status.error());
  }
  const auto sampled = diagnosis::SampleStack(stack, config.max_samples);
  if (!sampled) return Forward(sampled);
  Findings findings;
  CheckFrameCount(stack, findings);
  CheckSameFrames(stack, findings);
  const diagnosis::LightRange range = diagnosis::FindLightRange(*sampled, phase);
  diagnosis::CheckLight(*sampled, range, phase, config, findings);
  return findings.Take();
}

}  // namespace fringe_fusion
