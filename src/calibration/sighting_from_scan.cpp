#include "fringe_fusion/calibration/sighting_from_scan.hpp"

#include <algorithm>

namespace fringe_fusion {
namespace {

/// Whether a frame has a partner that makes the two of them even.
bool IsEven(const PatternSequence& sequence, const Pattern& pattern) {
  if (pattern.kind == PatternKind::kPhase) return pattern.carrier_steps == 0;
  if (pattern.kind != PatternKind::kGray) return false;
  return std::any_of(sequence.frames.begin(), sequence.frames.end(), [&](const Pattern& other) {
    return other.kind == PatternKind::kGray && other.axis == pattern.axis &&
           other.bit == pattern.bit && other.inverse != pattern.inverse &&
           other.exposure_ratio == pattern.exposure_ratio;
  });
}

}  // namespace

Result<Image<float>> EvenlyLitPicture(const ImageStack& stack) {
  if (Status status = Validate(stack, "stack"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  std::vector<std::size_t> used;
  for (std::size_t i = 0; i < stack.frames.size(); ++i) {
    if (IsEven(stack.sequence, stack.sequence.frames[i])) used.push_back(i);
  }
  if (used.empty()) {
    for (std::size_t i = 0; i < stack.frames.size(); ++i) {
      if (stack.sequence.frames[i].kind == PatternKind::kWhite) used = {i};
    }
  }
  if (used.empty()) {
    return Fail("no white frame, and no frames that even out, to see the target in");
  }
  Image<float> mean(Width(stack.frames.front()), Height(stack.frames.front()));
  for (const std::size_t i : used) {
    std::visit(
        [&](const auto& pixels) {
          for (std::size_t k = 0; k < mean.size(); ++k) mean[k] += static_cast<float>(pixels[k]);
        },
        stack.frames[i].pixels);
  }
  for (float& value : mean) value /= static_cast<float>(used.size());
  return mean;
}

Result<TargetSighting> SightTarget(const ImageStack& stack, const CalibrationTarget& target,
                                   const SightingConfig& config, const std::string& name) {
  const auto named = [&](const Error& error) { return Fail("{}: {}", name, error.message); };
  const Result<Image<float>> picture = EvenlyLitPicture(stack);
  if (!picture) return named(picture.error());
  const Result<TargetSighting> seen = DetectTarget(*picture, target, config.detect);
  if (!seen) return named(seen.error());
  const Result<PhaseMap> phase = DecodePhase(stack, config.phase);
  if (!phase) return named(phase.error());
  Result<TargetSighting> sighting =
      TransferToProjector(*phase, *seen, target, config.transfer, std::nullopt);
  if (!sighting) return named(sighting.error());
  sighting->name = name;
  return sighting;
}

Result<TargetSighting> ReadCalibrationPose(const ScanFolder& scan, int view_id,
                                           const CalibrationTarget& target,
                                           const SightingConfig& config) {
  const Result<ImageStack> stack = ReadStack(scan, view_id);
  if (!stack) return Forward(stack);
  return SightTarget(*stack, target, config, ViewFolder(scan, view_id));
}

}  // namespace fringe_fusion
