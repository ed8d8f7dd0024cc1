// fringe diagnose: what is wrong with the capture of a scan.
#include "capture_figures.hpp"
#include "command.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "views.hpp"

namespace fringe_fusion::cli {
namespace {

struct DiagnoseOptions {
  std::string scan;
  int view = -1;
  bool strict = false;
};

void Declare(Command& command, DiagnoseOptions& options) {
  command.AddOption("--scan", options.scan, "Scan folder with cell.yaml, patterns.yaml, views/")
      .Required()
      .TypeName("SCAN/");
  command.AddOption("--view", options.view, "Only this view (default: all)")
      .AtLeastZero()
      .TypeName("K");
  command.AddFlag("--strict", options.strict, "A finding is an error (exit status 1)");
}

Status Diagnose(const DiagnoseOptions& options, Session& session) {
  session.AdoptSettings(options.scan);
  const auto phase = session.LoadStage<PhaseConfig>("phase");
  if (!phase) return Forward(phase);
  const auto config = session.LoadStage<DiagnosisConfig>("diagnosis");
  if (!config) return Forward(config);
  const auto scan = OpenScan(options.scan);
  if (!scan) return Forward(scan);
  const auto ids = SelectViews(*scan, options.view);
  if (!ids) return Forward(ids);
  std::vector<ViewDiagnosis> views;
  std::vector<Json> figures;
  session.console.Begin("diagnose", static_cast<int>(ids->size()));
  for (const int id : *ids) {
    if (!session.console.Part(static_cast<int>(views.size()))("diagnose", 0.0)) {
      return Fail("{}", kCancelled);
    }
    const auto stack = ReadStack(*scan, id);
    if (!stack) return Forward(stack);
    views.push_back({id, DiagnoseStack(*stack, *phase, *config, scan->calibration)});
    if (!views.back().diagnosis) {
      return Fail("{}: {}", ViewFolder(*scan, id), views.back().diagnosis.error().message);
    }
    figures.push_back(DiagnosisFigures(views.back()));
  }
  session.console.End();
  for (const ViewDiagnosis& view : views) fmt::print("{}", DiagnosisText(view));
  const std::size_t num_findings = CountFindings(views);
  session.figures.Set("num_findings", num_findings).Set("views", figures);
  if (options.strict && num_findings > 0) {
    return Fail("{}: {} findings in {} views", options.scan, num_findings, views.size());
  }
  return {};
}

}  // namespace

void AddDiagnose(Tool& tool) {
  AddCommand<DiagnoseOptions>(tool, "diagnose",
                              "What is wrong with the capture of a scan, with evidence and advice",
                              Declare, Diagnose);
}

}  // namespace fringe_fusion::cli
