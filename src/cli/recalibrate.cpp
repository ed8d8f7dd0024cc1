// fringe recalibrate: one view of a target and an earlier cell.yaml -> what has moved, and
// cell.yaml.
#include <filesystem>

#include "command.hpp"
#include "fringe_fusion/calibration/drift.hpp"
#include "fringe_fusion/io/calibration_files.hpp"
#include "sighting_config.hpp"

namespace fringe_fusion::cli {
namespace {

struct RecalibrateOptions {
  std::string cell;
  std::string dataset;
  int view = 0;
  std::string target;
  std::string sightings;
  std::string out;
};

void Declare(Command& command, RecalibrateOptions& options) {
  command.AddOption("--cell", options.cell, "The earlier calibration; its covariance counts")
      .Required()
      .TypeName("CELL.yaml");
  const Option dataset =
      command.AddOption("--dataset", options.dataset, "Scan folder with a view of the target")
          .TypeName("SCAN/");
  command.AddOption("--view", options.view, "Number of the view")
      .Needs(dataset)
      .AtLeastZero()
      .ShowDefault();
  command.AddOption("--target", options.target, "Description of the target")
      .Needs(dataset)
      .TypeName("TARGET.yaml");
  command
      .AddOption("--sightings", options.sightings,
                 "Instead of a data set: points that were seen before, one sighting")
      .Excludes(dataset)
      .TypeName("SIGHTINGS.yaml");
  command.AddOption("--out", options.out, "Updated calibration").Required().TypeName("CELL.yaml");
}

struct OneSighting {
  CalibrationTarget target;
  TargetSighting sighting;
};

Status CheckCommandLine(const RecalibrateOptions& options) {
  if (options.dataset.empty() == options.sightings.empty()) {
    return Fail("exactly one of --dataset and --sightings is needed");
  }
  if (!options.dataset.empty() && options.target.empty()) {
    return Fail("--target: is required with --dataset");
  }
  return {};
}

Result<OneSighting> LookOnce(const RecalibrateOptions& options, Session& session) {
  if (options.dataset.empty()) {
    auto file = LoadSightings(options.sightings);
    if (!file) return Forward(file);
    if (file->sightings.size() != 1) {
      return Fail("{}: has {} sightings, one is needed", options.sightings, file->sightings.size());
    }
    return OneSighting{file->target, std::move(file->sightings.front())};
  }
  const auto stages = LoadSightingConfig(session);
  if (!stages) return Forward(stages);
  const auto target = LoadTarget(options.target);
  if (!target) return Forward(target);
  const auto scan = OpenUncalibratedScan(options.dataset);
  if (!scan) return Forward(scan);
  auto sighting = ReadCalibrationPose(*scan, options.view, *target, *stages);
  if (!sighting) return Forward(sighting);
  return OneSighting{*target, std::move(*sighting)};
}

Status Recalibrate(const RecalibrateOptions& options, Session& session) {
  if (Status status = CheckOutputFile(options.out, {".yaml"}); !status) return status;
  if (!options.dataset.empty()) session.AdoptSettings(options.dataset);
  const auto config = session.LoadStage<DriftConfig>("drift");
  if (!config) return Forward(config);
  const auto cell = ReadCellCalibration(options.cell);
  if (!cell) return Forward(cell);
  const auto covariance = ReadCellCovariance(options.cell);
  if (!covariance) return Forward(covariance);
  const auto seen = LookOnce(options, session);
  if (!seen) return Forward(seen);
  const auto result = UpdateCell(*cell, *covariance, seen->target, seen->sighting, *config);
  if (!result) return Forward(result);
  for (const std::string& direction : result->observed) fmt::print("told: {}\n", direction);
  fmt::print("{}\n", result->words);
  session.figures.Set("has_moved", result->has_moved)
      .Set("words", result->words)
      .Set("num_observed", result->num_observed)
      .Set("chi2_ratio", result->chi2_ratio)
      .Set("rms_before_px", result->rms_before_px)
      .Set("rms_after_px", result->rms_after_px);
  CellCalibrationResult updated;
  updated.calibration = result->calibration;
  updated.covariance = result->covariance;
  updated.verdict.words = result->words;
  return WriteCalibratedCell(updated, options.out);
}

}  // namespace

void AddRecalibrate(Tool& tool) {
  AddCommand<RecalibrateOptions>(
      tool, "recalibrate",
      "One view of a target -> what of the cell has moved, and the calibration with that updated",
      Declare, Recalibrate, CheckCommandLine);
}

}  // namespace fringe_fusion::cli
