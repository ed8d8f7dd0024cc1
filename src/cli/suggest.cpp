// fringe suggest: test exposures and a budget -> exposure times, frequencies and steps.
#include <filesystem>

#include "command.hpp"
#include "fringe_fusion/diagnosis/capture_assistant.hpp"
#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "views.hpp"

namespace fringe_fusion::cli {
namespace {

struct SuggestOptions {
  std::string scan;
  std::string out;
  int view = -1;
  CaptureBudget budget;
};

void Declare(Command& command, SuggestOptions& options) {
  command
      .AddOption("--scan", options.scan,
                 "Scan of test exposures that states its exposure times; `fringe patterns "
                 "--test-exposures` makes its patterns")
      .Required()
      .TypeName("TESTSCAN/");
  command.AddOption("--view", options.view, "View of the scan (default: the first)")
      .AtLeastZero()
      .TypeName("K");
  const Option frames =
      command.AddOption("--frames", options.budget.frames, "Frames that a view may have")
          .InRange(1, 10000)
          .TypeName("N");
  command.AddOption("--seconds", options.budget.seconds, "Time that a view may take, instead [s]")
      .InRange(1e-3, 1e5)
      .Excludes(frames)
      .TypeName("S");
  command.AddOption("--out", options.out, "Write these settings as pattern.yaml")
      .TypeName("PATTERN.yaml");
}

Status WritePattern(const CaptureProposal& proposal, const std::string& path) {
  const PatternConfig pattern = ToPatternConfig(proposal.settings);
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream << fmt::format("# At an exposure of {:.10g} s.\n", proposal.settings.exposures_s.front())
           << fmt::format("axis_u: {}\naxis_v: {}\nfringes: \"{}\"\nsteps: {}\nexposures: \"{}\"\n",
                          pattern.axis_u, pattern.axis_v, pattern.fringes, pattern.steps,
                          pattern.exposures);
    return {};
  });
}

void Print(const CaptureProposal& proposal) {
  const CaptureSettings& settings = proposal.settings;
  fmt::print("exposures {:g} s\n", fmt::join(settings.exposures_s, " + "));
  fmt::print("fringes {:g} on {}, {} steps each\n", fmt::join(settings.fringes, ", "),
             settings.axis_u && settings.axis_v ? "u and v" : (settings.axis_u ? "u" : "v"),
             settings.steps);
  fmt::print("{} frames, {:.3g} s\n", proposal.num_frames, proposal.seconds);
  fmt::print("predicted depth sigma {:.4f} mm, {:.1f} % of the visible surface valid\n",
             proposal.prediction.sigma_depth_m * 1e3, 100.0 * proposal.prediction.valid_ratio);
  for (const std::string& note : proposal.notes) fmt::print("note: {}\n", note);
}

void SetFigures(const CaptureProposal& proposal, Json& figures) {
  const CaptureSettings& settings = proposal.settings;
  figures.Set("exposures_s", fmt::format("{:.10g}", fmt::join(settings.exposures_s, ",")))
      .Set("fringes", fmt::format("{:g}", fmt::join(settings.fringes, ",")))
      .Set("steps", settings.steps)
      .Set("axis_u", settings.axis_u)
      .Set("axis_v", settings.axis_v)
      .Set("num_frames", proposal.num_frames)
      .Set("capture_s", proposal.seconds)
      .Set("sigma_depth_m", proposal.prediction.sigma_depth_m)
      .Set("valid_ratio", proposal.prediction.valid_ratio)
      .Set("ripple_rad", proposal.prediction.ripple_rad)
      .Set("num_compared", proposal.num_compared);
}

Status CheckCommandLine(const SuggestOptions& options) {
  if (options.budget.frames != 0 || options.budget.seconds != 0.0) return {};
  return Fail("one of --frames and --seconds is needed");
}

Status Suggest(const SuggestOptions& options, Session& session) {
  if (!options.out.empty()) {
    if (Status status = CheckOutputFile(options.out, {".yaml"}); !status) return status;
  }
  session.AdoptSettings(options.scan);
  const auto phase = session.LoadStage<PhaseConfig>("phase");
  if (!phase) return Forward(phase);
  const auto config = session.LoadStage<CaptureAssistantConfig>("capture_assistant");
  if (!config) return Forward(config);
  const auto scan = OpenScan(options.scan);
  if (!scan) return Forward(scan);
  const auto ids = SelectViews(*scan, options.view);
  if (!ids) return Forward(ids);
  const std::string owner = ViewFolder(*scan, ids->front());
  session.console.Begin("suggest", 1);
  const auto test = ReadStack(*scan, ids->front());
  if (!test) return Forward(test);
  const auto scene = MeasureCaptureScene(*test, scan->calibration, *phase, *config);
  if (!scene) return Fail("{}: {}", owner, scene.error().message);
  const auto proposal = ProposeCapture(*scene, *phase, *config, options.budget);
  if (!proposal) return Fail("{}: {}", owner, proposal.error().message);
  session.console.End();
  Print(*proposal);
  SetFigures(*proposal, session.figures);
  return options.out.empty() ? Status() : WritePattern(*proposal, options.out);
}

}  // namespace

void AddSuggest(Tool& tool) {
  AddCommand<SuggestOptions>(
      tool, "suggest",
      "Test exposures and a budget -> exposure times, frequencies and steps of least depth sigma",
      Declare, Suggest, CheckCommandLine);
}

}  // namespace fringe_fusion::cli
