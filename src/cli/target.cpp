// fringe target: kind and size of a calibration target -> a drawing true to scale and target.yaml.
#include <cmath>
#include <filesystem>

#include "command.hpp"
#include "fringe_fusion/calibration/target_print.hpp"
#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/target_drawing.hpp"

namespace fringe_fusion::cli {
namespace {

struct TargetOptions {
  std::string kind;
  int columns = 0;
  int rows = 0;
  double pitch_mm = 0.0;
  double dot_mm = 0.0;
  double ring_mm = 0.0;
  double marker_mm = 0.0;
  int dictionary = -1;
  int shifts = 4;
  double sigma_print_mm = 0.0;
  bool no_marks = false;
  bool light_on_dark = false;
  std::string paper = "a4";
  std::string out;
};

void DeclareSizes(Command& command, TargetOptions& options) {
  command.AddOption("--dot-mm", options.dot_mm, "Diameter of the dots (default: half the pitch)")
      .TypeName("MM");
  command
      .AddOption("--ring-mm", options.ring_mm,
                 "Outer diameter of the white rings of ring_dots (default: .9 of the pitch)")
      .TypeName("MM");
  command
      .AddOption("--marker-mm", options.marker_mm,
                 "Edge of the ChArUco markers (default: .7 of the pitch)")
      .TypeName("MM");
  command
      .AddOption("--dictionary", options.dictionary,
                 "OpenCV's number of the ChArUco dictionary (default: the smallest of 4 x 4 bits "
                 "that is large enough)")
      .TypeName("N");
  command
      .AddOption("--shifts", options.shifts, "Columns of shifted_dots until the shift starts anew")
      .TypeName("M")
      .ShowDefault();
  command
      .AddOption("--sigma-print-mm", options.sigma_print_mm,
                 "Standard deviation of the printed points from their places, each axis")
      .TypeName("MM")
      .ShowDefault();
}

void Declare(Command& command, TargetOptions& options) {
  command
      .AddOption("--kind", options.kind,
                 "chessboard, charuco, circles, asymmetric_circles, ring_dots or shifted_dots")
      .Required()
      .TypeName("KIND");
  command.AddOption("--columns", options.columns, "Points along x (inner corners, dots)")
      .Required()
      .TypeName("N");
  command.AddOption("--rows", options.rows, "Points along y").Required().TypeName("N");
  command.AddOption("--pitch-mm", options.pitch_mm, "Distance of neighbouring points in a row")
      .Required()
      .TypeName("MM");
  DeclareSizes(command, options);
  command.AddFlag("--no-marks", options.no_marks,
                  "Do not enlarge three dots that tell orientation and place");
  command.AddFlag("--light-on-dark", options.light_on_dark, "White dots on black");
  command
      .AddOption("--paper", options.paper,
                 fmt::format("{}, or WIDTHxHEIGHT in mm", fmt::join(PaperNames(), ", ")))
      .TypeName("PAPER")
      .ShowDefault();
  command
      .AddOption("--out", options.out, "Drawing; the target's description goes beside it, as .yaml")
      .Required()
      .TypeName("TARGET.pdf|.svg");
}

Status CheckCommandLine(const TargetOptions& options) {
  const Result<TargetKind> kind = TargetKindFromName(options.kind);
  if (!kind) return Fail("--{}", kind.error().message);
  const Result<Paper> paper = PaperFromName(options.paper);
  if (!paper) return Fail("--{}", paper.error().message);
  return {};
}

/// Three dots about the middle, unequal steps apart: they tell orientation, mirroring and place.
void Mark(CalibrationTarget& target) {
  if (target.num_columns < 4 || target.num_rows < 4) return;
  const int column = target.num_columns / 2 - 1;
  const int row = target.num_rows / 2 - 1;
  const auto at = [&](int x, int y) { return y * target.num_columns + x; };
  target.marked_points = {at(column, row), at(column + 1, row), at(column, row + 2)};
  target.marked_radius_m = 1.35 * target.dot_radius_m;
  if (target.kind == TargetKind::kRingDots) {
    target.marked_radius_m = std::min(target.marked_radius_m, 0.8 * target.ring_radius_m);
  }
}

Result<CalibrationTarget> MakeTarget(const TargetOptions& options) {
  const Result<TargetKind> kind = TargetKindFromName(options.kind);
  if (!kind) return Forward(kind);
  CalibrationTarget target;
  target.kind = *kind;
  target.num_columns = options.columns;
  target.num_rows = options.rows;
  target.pitch_m = 1e-3 * options.pitch_mm;
  target.sigma_print_m = 1e-3 * options.sigma_print_mm;
  target.light_on_dark = options.light_on_dark;
  if (HasDots(*kind)) {
    target.dot_radius_m = options.dot_mm != 0.0 ? 0.5e-3 * options.dot_mm : 0.25 * target.pitch_m;
  }
  if (*kind == TargetKind::kRingDots) {
    target.ring_radius_m =
        options.ring_mm != 0.0 ? 0.5e-3 * options.ring_mm : 0.45 * target.pitch_m;
    target.print_ratio = 0.5;  // enough light on the dots to decode, enough contrast to see them
  }
  if (*kind == TargetKind::kShiftedDots) target.num_shifts = options.shifts;
  const bool takes_marks = HasDots(*kind) && *kind != TargetKind::kAsymmetricCircles;
  if (takes_marks && !options.no_marks) Mark(target);
  if (*kind == TargetKind::kCharuco) {
    target.marker_m = options.marker_mm != 0.0 ? 1e-3 * options.marker_mm : 0.7 * target.pitch_m;
    const int needed = (target.num_columns + 1) * (target.num_rows + 1) / 2;
    const int smallest = needed <= 50 ? 0 : needed <= 100 ? 1 : needed <= 250 ? 2 : 3;
    target.dictionary = options.dictionary >= 0 ? options.dictionary : smallest;
  }
  return target;
}

Status DrawTargetFiles(const TargetOptions& options, Session& session) {
  const Result<CalibrationTarget> target = MakeTarget(options);
  if (!target) return tl::unexpected(target.error());
  const Result<Paper> paper = PaperFromName(options.paper);
  if (!paper) return Forward(paper);
  const std::string yaml = std::filesystem::path(options.out).replace_extension(".yaml").string();
  if (Status status = CheckOutputFile(options.out, {".pdf", ".svg"}); !status) return status;
  if (Status status = CheckOutputFile(yaml, {}); !status) return status;
  if (Status status = DrawTarget(*target, *paper, options.out); !status) return status;
  if (Status status = SaveTarget(*target, yaml); !status) return status;
  const TargetPrint print = MakeTargetPrint(*target);
  session.figures.Set("num_points", target->num_columns * target->num_rows)
      .Set("width_m", print.max_m.x() - print.min_m.x())
      .Set("height_m", print.max_m.y() - print.min_m.y());
  fmt::print("{}, {}: {} points, print at 100 %\n", options.out, yaml,
             target->num_columns * target->num_rows);
  return {};
}

}  // namespace

void AddTarget(Tool& tool) {
  AddCommand<TargetOptions>(tool, "target",
                            "A calibration target -> a drawing true to scale and target.yaml",
                            Declare, DrawTargetFiles, CheckCommandLine);
}

}  // namespace fringe_fusion::cli
