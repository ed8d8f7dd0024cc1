#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/diagnosis/diagnosis_config.hpp"
#include "fringe_fusion/phase/phase_map.hpp"

namespace fringe_fusion {

/// What can be wrong with a capture. The order is that of causes: a kind may feign later ones, but
/// no earlier one, and findings are reported in this order.
enum class FindingKind {
  kFramesDropped,
  kFramesDuplicated,
  kFramesShifted,
  kFramesSwapped,
  kSaturation,
  kTooLittleLight,
  kResponse,
  kExposure,
  kFlicker,
  kMotion,
  kResolution,
  kCameraDefocus,
  kProjectorDefocus,
  kInterreflection,
};
constexpr int kNumFindingKinds = 14;

/// Stable name for JSON, /diagnostics and the report, e.g. "frames_dropped"; "unknown" outside the
/// enumeration.
[[nodiscard]] const char* FindingName(FindingKind kind);

/// One thing that is wrong.
struct Finding {
  FindingKind kind = FindingKind::kFramesDropped;
  double value = 0.0;    ///< measured
  double limit = 0.0;    ///< that the value misses
  std::string unit;      ///< of both; empty for ratios and counts
  std::string evidence;  ///< value, limit and where, in words
  std::string advice;    ///< what to do
};

enum class CheckState {
  kPassed,
  kFailed,   ///< there is a Finding of this kind
  kSkipped,  ///< does not apply to this stack, or an earlier finding spoils it: see `note`
};
[[nodiscard]] const char* CheckStateName(CheckState state);  ///< "passed", "failed", "skipped"

/// One quantity that was examined, also where it is as it should be.
struct Check {
  FindingKind kind = FindingKind::kFramesDropped;
  CheckState state = CheckState::kSkipped;
  std::string quantity;  ///< what `value` is, in words
  double value = 0.0;    ///< NaN when skipped
  double limit = 0.0;
  bool is_minimum = false;  ///< the value must be at least the limit, else at most
  std::string unit;
  std::string note;  ///< why it was skipped; else empty
};

struct Diagnosis {
  std::vector<Finding> findings;  ///< the cause of the others first; empty: nothing is wrong
  std::vector<Check> checks;      ///< one per kind, in the order of FindingKind
};

/// Examines a captured stack before it is decoded and names what is wrong. Looks at
/// config.max_samples pixels; deterministic.
///
/// A check that cannot judge this stack (no phase steps, no calibration, too few pixels with light)
/// is skipped and says so; it never finds anything. Frames in a wrong order spoil all later
/// checks, which are then skipped.
/// @param stack whose number of frames need not fit its sequence: missing frames are a finding.
/// @param phase supplies the sensor noise where the stack does not tell it, and the saturation.
/// @param calibration of the scanner that took the stack; without it the projector's resolution
/// cannot be judged.
/// @return error when there are no frames, no patterns, more frames than patterns, sizes or bit
/// depths that differ, a sequence that Validate refuses, or a config out of bounds.
/// Ref: docs/diagnosis.md, which lists every quantity with its limit; science section 2.
[[nodiscard]] Result<Diagnosis> DiagnoseStack(
    const ImageStack& stack, const PhaseConfig& phase, const DiagnosisConfig& config,
    const std::optional<CellCalibration>& calibration = std::nullopt);

}  // namespace fringe_fusion
