#include "fringe_fusion/ros_io/pattern_messages.hpp"

namespace fringe_fusion::ros_io {
namespace {

const char* KindName(PatternKind kind) {
  switch (kind) {
    case PatternKind::kWhite:
      return "white";
    case PatternKind::kBlack:
      return "black";
    case PatternKind::kGray:
      return "gray";
    case PatternKind::kPhase:
      return "phase";
    case PatternKind::kMicro:
      return "micro";
  }
  return "unknown";
}

Result<PatternKind> KindFromName(const std::string& name) {
  for (const PatternKind kind : {PatternKind::kWhite, PatternKind::kBlack, PatternKind::kGray,
                                 PatternKind::kPhase, PatternKind::kMicro}) {
    if (name == KindName(kind)) return kind;
  }
  return Fail("pattern kind '{}' must be white, black, gray, phase or micro", name);
}

}  // namespace

PatternDescription ToMessage(const Pattern& pattern) {
  PatternDescription message;
  message.kind = KindName(pattern.kind);
  message.axis = pattern.axis == Axis::kU ? "u" : "v";
  message.exposure_ratio = pattern.exposure_ratio;
  message.bit = pattern.bit;
  message.inverse = static_cast<std::uint8_t>(pattern.inverse);
  message.cell_px = pattern.cell_px;
  message.offset_px = pattern.offset_px;
  message.fringes = pattern.fringes;
  message.step = pattern.step;
  message.steps = pattern.steps;
  message.phase_sign = pattern.phase_sign;
  message.phase_offset_rad = pattern.phase_offset_rad;
  message.carrier_period_px = pattern.carrier_period_px;
  message.carrier_step = pattern.carrier_step;
  message.carrier_steps = pattern.carrier_steps;
  return message;
}

Result<Pattern> FromMessage(const PatternDescription& message) {
  const Result<PatternKind> kind = KindFromName(message.kind);
  if (!kind) return Forward(kind);
  if (message.axis != "u" && message.axis != "v") {
    return Fail("pattern axis '{}' must be u or v", message.axis);
  }
  Pattern pattern;
  pattern.kind = *kind;
  pattern.axis = message.axis == "u" ? Axis::kU : Axis::kV;
  pattern.exposure_ratio = message.exposure_ratio;
  pattern.bit = message.bit;
  pattern.inverse = message.inverse != 0;
  pattern.cell_px = message.cell_px;
  pattern.offset_px = message.offset_px;
  pattern.fringes = message.fringes;
  pattern.step = message.step;
  pattern.steps = message.steps;
  pattern.phase_sign = message.phase_sign;
  pattern.phase_offset_rad = message.phase_offset_rad;
  pattern.carrier_period_px = message.carrier_period_px;
  pattern.carrier_step = message.carrier_step;
  pattern.carrier_steps = message.carrier_steps;
  return pattern;
}

PatternList ToMessage(const PatternSequence& sequence) {
  PatternList message;
  message.width = static_cast<std::uint32_t>(sequence.width);
  message.height = static_cast<std::uint32_t>(sequence.height);
  for (const Pattern& pattern : sequence.frames) message.frames.push_back(ToMessage(pattern));
  return message;
}

Result<PatternSequence> FromMessage(const PatternList& message) {
  PatternSequence sequence;
  sequence.width = static_cast<int>(message.width);
  sequence.height = static_cast<int>(message.height);
  for (const PatternDescription& frame : message.frames) {
    const Result<Pattern> pattern = FromMessage(frame);
    if (!pattern) return Forward(pattern);
    sequence.frames.push_back(*pattern);
  }
  if (Status status = Validate(sequence, "pattern list"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return sequence;
}

}  // namespace fringe_fusion::ros_io
