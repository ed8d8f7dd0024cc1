#include "target_yaml.hpp"

#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/file.hpp"

namespace fringe_fusion {
namespace internal {

void ReadTarget(YamlFields& fields, CalibrationTarget& target) {
  std::string kind;
  fields.Required("kind", kind);
  fields.Required("columns", target.num_columns);
  fields.Required("rows", target.num_rows);
  fields.Required("pitch_m", target.pitch_m);
  fields.Optional("dot_radius_m", target.dot_radius_m);
  fields.Optional("ring_radius_m", target.ring_radius_m);
  fields.Optional("marker_m", target.marker_m);
  fields.Optional("dictionary", target.dictionary);
  fields.Optional("num_shifts", target.num_shifts);
  fields.Optional("sigma_print_m", target.sigma_print_m);
  fields.Optional("print_ratio", target.print_ratio);
  fields.Optional("light_on_dark", target.light_on_dark);
  fields.Optional("marked_points", target.marked_points);
  fields.Optional("marked_radius_m", target.marked_radius_m);
  if (!fields.ok()) return;
  const Result<TargetKind> known = TargetKindFromName(kind);
  if (!known) {
    fields.Reject(known.error().message);
    return;
  }
  target.kind = *known;
}

std::string TargetYaml(const CalibrationTarget& target) {
  const CalibrationTarget neutral;
  std::string text =
      fmt::format("kind: {}\ncolumns: {}\nrows: {}\npitch_m: {}\n", TargetKindName(target.kind),
                  target.num_columns, target.num_rows, target.pitch_m);
  const auto add = [&](const char* key, const auto& value, const auto& left_out) {
    if (value != left_out) text += fmt::format("{}: {}\n", key, value);
  };
  add("dot_radius_m", target.dot_radius_m, neutral.dot_radius_m);
  add("ring_radius_m", target.ring_radius_m, neutral.ring_radius_m);
  add("marker_m", target.marker_m, neutral.marker_m);
  if (target.kind == TargetKind::kCharuco)
    text += fmt::format("dictionary: {}\n", target.dictionary);
  add("num_shifts", target.num_shifts, neutral.num_shifts);
  add("sigma_print_m", target.sigma_print_m, neutral.sigma_print_m);
  add("print_ratio", target.print_ratio, neutral.print_ratio);
  add("light_on_dark", target.light_on_dark, neutral.light_on_dark);
  if (!target.marked_points.empty()) {
    text += fmt::format("marked_points: [{}]\nmarked_radius_m: {}\n",
                        fmt::join(target.marked_points, ", "), target.marked_radius_m);
  }
  return text;
}

}  // namespace internal

Result<CalibrationTarget> LoadTarget(const std::string& path) {
  const Result<YAML::Node> root = internal::LoadYaml(path);
  if (!root) return Forward(root);
  CalibrationTarget target;
  internal::YamlFields fields(*root, path);
  internal::ReadTarget(fields, target);
  Status status = fields.Finish();
  if (status) status = Validate(target, path);
  if (!status) return tl::unexpected<Error>(status.error());
  return target;
}

Status SaveTarget(const CalibrationTarget& target, const std::string& path) {
  if (Status status = Validate(target, path); !status) return status;
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream << "# Calibration target; x along the columns, y along the rows, lengths in metres\n"
           << internal::TargetYaml(target);
    return {};
  });
}

}  // namespace fringe_fusion
