// fringe decode, fringe reconstruct: frames -> phase maps -> range images, view by view.
#include <filesystem>

#include "command.hpp"
#include "figures.hpp"
#include "fringe_fusion/inspection/mask_picture.hpp"
#include "fringe_fusion/io/image_io.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "staged_folder.hpp"
#include "views.hpp"

namespace fringe_fusion::cli {
namespace {

struct ReconstructOptions {
  std::string scan;
  std::string out;
  int view = -1;
};

void Declare(Command& command, ReconstructOptions& options) {
  command.AddOption("--scan", options.scan, "Scan folder with cell.yaml, patterns.yaml, views/")
      .Required()
      .TypeName("SCAN/");
  command.AddOption("--view", options.view, "Only this view (default: all)")
      .AtLeastZero()
      .TypeName("K");
  command.AddOption("--out", options.out, "Write below this folder instead of the scan folder")
      .TypeName("DIR");
}

/// The scan as a place to write to.
ScanFolder OutputFolder(const ScanFolder& scan, const std::string& out) {
  ScanFolder target = scan;
  if (!out.empty()) target.path = out;
  return target;
}

/// The reasons in colours, and what each colour means.
Status WriteMaskPictures(const PhaseMap& phase, const std::string& folder) {
  const std::filesystem::path path(folder);
  if (Status status = WriteImage(RenderMask(phase.mask), (path / "mask_color.png").string());
      !status) {
    return status;
  }
  return WriteImage(MaskLegend(), (path / "mask_legend.png").string());
}

Status Decode(const ReconstructOptions& options, Session& session) {
  session.AdoptSettings(options.scan);
  const auto config = LoadDecodeConfig(session);
  if (!config) return Forward(config);
  const auto scan = OpenScan(options.scan);
  if (!scan) return Forward(scan);
  const auto ids = SelectViews(*scan, options.view);
  if (!ids) return Forward(ids);
  const ScanFolder target = OutputFolder(*scan, options.out);
  std::vector<Json> figures;
  PhaseMap last;  // its memory takes the next view
  session.console.Begin("decode", static_cast<int>(ids->size()));
  for (const int id : *ids) {
    const Progress progress = session.console.Part(static_cast<int>(figures.size()));
    const auto stack = ReadStack(*scan, id);
    if (!stack) return Forward(stack);
    auto phase = DecodeView(*stack, *config, ViewFolder(*scan, id), progress, std::move(last));
    if (!phase) return Forward(phase);
    const auto folder = NeededFolder::Create(ViewFolder(target, id));
    if (!folder) return Forward(folder);
    if (Status status = WritePhaseMap(target, id, *phase); !status) return status;
    if (Status status = WriteMaskPictures(*phase, ViewFolder(target, id)); !status) return status;
    figures.push_back(PhaseFigures(id, *phase));
    last = std::move(*phase);
  }
  session.console.End();
  session.figures.Set("views", figures);
  return {};
}

Status Reconstruct(const ReconstructOptions& options, Session& session) {
  session.AdoptSettings(options.scan);
  const auto config = LoadReconstructConfig(session);
  if (!config) return Forward(config);
  const auto scan = OpenScan(options.scan);
  if (!scan) return Forward(scan);
  const auto ids = SelectViews(*scan, options.view);
  if (!ids) return Forward(ids);
  const ScanFolder target = OutputFolder(*scan, options.out);
  std::vector<Json> figures;
  session.console.Begin("reconstruct", static_cast<int>(ids->size()));
  for (const int id : *ids) {
    const Progress progress = session.console.Part(static_cast<int>(figures.size()));
    const auto made = ReconstructView(*scan, id, *config, progress);
    if (!made) return Forward(made);
    const std::string file = (std::filesystem::path(target.path) / RangeFile(id)).string();
    const auto folder = NeededFolder::Create(ViewFolder(target, id));
    if (!folder) return Forward(folder);
    if (Status status = WriteRangeImage(made->triangulation.range, file); !status) return status;
    figures.push_back(RangeFigures(id, made->triangulation));
  }
  session.console.End();
  session.figures.Set("calibration_id", CalibrationId(scan->calibration));
  session.figures.Set("views", figures);
  return {};
}

}  // namespace

void AddDecode(Tool& tool) {
  AddCommand<ReconstructOptions>(tool, "decode",
                                 "Frames -> phase maps: u, v, sigma_u, sigma_v, modulation (.tiff) "
                                 "and mask.png per view, the mask also in colours, with a legend",
                                 Declare, Decode);
}

void AddReconstruct(Tool& tool) {
  AddCommand<ReconstructOptions>(tool, "reconstruct", "Frames -> range images: range.ply per view",
                                 Declare, Reconstruct);
}

}  // namespace fringe_fusion::cli
