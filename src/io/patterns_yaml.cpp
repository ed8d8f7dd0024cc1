#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "yaml_fields.hpp"

namespace fringe_fusion {
namespace {

using internal::YamlFields;

void ReadAxis(YamlFields& fields, Pattern& pattern) {
  std::string axis;
  fields.Required("axis", axis);
  if (!fields.ok()) return;
  if (axis != "u" && axis != "v") {
    fields.Reject(fmt::format("axis = {} must be u or v", axis));
    return;
  }
  pattern.axis = axis == "u" ? Axis::kU : Axis::kV;
}

void ReadPattern(YamlFields& fields, Pattern& pattern) {
  std::string kind;
  fields.Required("kind", kind);
  if (!fields.ok()) return;
  if (kind == "white") {
    pattern.kind = PatternKind::kWhite;
  } else if (kind == "black") {
    pattern.kind = PatternKind::kBlack;
  } else if (kind == "gray") {
    pattern.kind = PatternKind::kGray;
    ReadAxis(fields, pattern);
    fields.Required("bit", pattern.bit);
    fields.Optional("inverse", pattern.inverse);
    fields.Optional("cell_px", pattern.cell_px);
    fields.Optional("offset_px", pattern.offset_px);
  } else if (kind == "phase" || kind == "micro") {
    pattern.kind = kind == "phase" ? PatternKind::kPhase : PatternKind::kMicro;
    ReadAxis(fields, pattern);
    fields.Required("fringes", pattern.fringes);
    fields.Required("step", pattern.step);
    fields.Required("steps", pattern.steps);
    fields.Optional("phase_sign", pattern.phase_sign);
    fields.Optional("phase_offset_rad", pattern.phase_offset_rad);
    if (kind == "phase") {
      fields.Optional("carrier_period_px", pattern.carrier_period_px);
      fields.Optional("carrier_step", pattern.carrier_step);
      fields.Optional("carrier_steps", pattern.carrier_steps);
    }
  } else {
    fields.Reject(fmt::format("kind = {} must be white, black, gray, phase or micro", kind));
  }
  fields.Optional("exposure_ratio", pattern.exposure_ratio);
}

std::string GrayYaml(const Pattern& p) {
  std::string text = fmt::format(", bit: {}, inverse: {}", p.bit, p.inverse);
  if (p.cell_px != 1.0) text += fmt::format(", cell_px: {}", p.cell_px);
  if (p.offset_px != 0.0) text += fmt::format(", offset_px: {}", p.offset_px);
  return text;
}

std::string FringeYaml(const Pattern& p) {
  std::string text = fmt::format(", fringes: {}, step: {}, steps: {}", p.fringes, p.step, p.steps);
  if (p.phase_sign != 1.0) text += fmt::format(", phase_sign: {}", p.phase_sign);
  if (p.phase_offset_rad != 0.0) text += fmt::format(", phase_offset_rad: {}", p.phase_offset_rad);
  if (p.kind == PatternKind::kPhase && p.carrier_steps != 0) {
    text += fmt::format(", carrier_period_px: {}, carrier_step: {}, carrier_steps: {}",
                        p.carrier_period_px, p.carrier_step, p.carrier_steps);
  }
  return text;
}

// What is at its default is left out.
std::string PatternYaml(const Pattern& p) {
  const char* axis = p.axis == Axis::kU ? "u" : "v";
  std::string text;
  switch (p.kind) {
    case PatternKind::kWhite:
      text = "kind: white";
      break;
    case PatternKind::kBlack:
      text = "kind: black";
      break;
    case PatternKind::kGray:
      text = fmt::format("kind: gray, axis: {}", axis) + GrayYaml(p);
      break;
    case PatternKind::kPhase:
      text = fmt::format("kind: phase, axis: {}", axis) + FringeYaml(p);
      break;
    case PatternKind::kMicro:
      text = fmt::format("kind: micro, axis: {}", axis) + FringeYaml(p);
      break;
  }
  if (p.exposure_ratio != 1.0) text += fmt::format(", exposure_ratio: {}", p.exposure_ratio);
  return "{" + text + "}";
}

}  // namespace

Result<PatternSequence> ReadPatterns(const std::string& path) {
  const Result<YAML::Node> root = internal::LoadYaml(path);
  if (!root) return Forward(root);
  PatternSequence sequence;
  YamlFields fields(*root, path);
  fields.Nested("projector", [&](YamlFields& projector) {
    projector.Required("width", sequence.width);
    projector.Required("height", sequence.height);
  });
  for (const YAML::Node& node : fields.List("frames")) {
    YamlFields frame(node, fmt::format("{}: frame {}", path, sequence.frames.size()));
    Pattern pattern;
    ReadPattern(frame, pattern);
    if (Status status = frame.Finish(); !status) return tl::unexpected<Error>(status.error());
    sequence.frames.push_back(pattern);
  }
  if (Status status = fields.Finish(); !status) return tl::unexpected<Error>(status.error());
  if (Status status = Validate(sequence, path); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return sequence;
}

Status WritePatterns(const PatternSequence& sequence, const std::string& path) {
  if (Status status = Validate(sequence, path); !status) return status;
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream << fmt::format("projector: {{width: {}, height: {}}}\nframes:\n", sequence.width,
                          sequence.height);
    for (const Pattern& pattern : sequence.frames) stream << "  - " << PatternYaml(pattern) << '\n';
    return {};
  });
}

}  // namespace fringe_fusion
