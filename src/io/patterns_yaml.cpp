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
  } else if (kind == "phase") {
    pattern.kind = PatternKind::kPhase;
    ReadAxis(fields, pattern);
    fields.Required("fringes", pattern.fringes);
    fields.Required("step", pattern.step);
    fields.Required("steps", pattern.steps);
    fields.Optional("phase_sign", pattern.phase_sign);
    fields.Optional("phase_offset_rad", pattern.phase_offset_rad);
  } else {
    fields.Reject(fmt::format("kind = {} must be white, black, gray or phase", kind));
  }
}

std::string PatternYaml(const Pattern& p) {
  const char* axis = p.axis == Axis::kU ? "u" : "v";
  std::string text;
  switch (p.kind) {
    case PatternKind::kWhite:
      return "{kind: white}";
    case PatternKind::kBlack:
      return "{kind: black}";
    case PatternKind::kGray:
      text = fmt::format("{{kind: gray, axis: {}, bit: {}, inverse: {}", axis, p.bit, p.inverse);
      if (p.cell_px != 1) text += fmt::format(", cell_px: {}", p.cell_px);
      if (p.offset_px != 0.0) text += fmt::format(", offset_px: {}", p.offset_px);
      return text + "}";
    case PatternKind::kPhase:
      text = fmt::format("{{kind: phase, axis: {}, fringes: {}, step: {}, steps: {}", axis,
                         p.fringes, p.step, p.steps);
      if (p.phase_sign != 1.0) text += fmt::format(", phase_sign: {}", p.phase_sign);
      if (p.phase_offset_rad != 0.0) {
        text += fmt::format(", phase_offset_rad: {}", p.phase_offset_rad);
      }
      return text + "}";
  }
  return text;
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
