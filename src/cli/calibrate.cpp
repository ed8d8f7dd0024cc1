// fringe calibrate: a folder of scans of a target -> cell.yaml with covariance and a verdict.
#include <filesystem>

#include "command.hpp"
#include "fringe_fusion/calibration/calibrate_cell.hpp"
#include "fringe_fusion/inspection/calibration_report.hpp"
#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/file.hpp"
#include "sighting_config.hpp"
#include "staged_folder.hpp"
#include "views.hpp"

namespace fringe_fusion::cli {
namespace {

struct CalibrateOptions {
  std::string dataset;
  std::string target;
  std::string sightings;
  std::string save_sightings;
  std::string out;
  std::string camera_info;
  std::string report;
  bool force = false;
};

void Declare(Command& command, CalibrateOptions& options) {
  const Option dataset =
      command
          .AddOption("--dataset", options.dataset,
                     "Scan folder whose views are poses of the target; needs no cell.yaml")
          .TypeName("SCAN/");
  command.AddOption("--target", options.target, "Description of the target")
      .Needs(dataset)
      .TypeName("TARGET.yaml");
  command
      .AddOption("--sightings", options.sightings,
                 "Instead of a data set: points that were seen before")
      .Excludes(dataset)
      .TypeName("SIGHTINGS.yaml");
  command
      .AddOption("--save-sightings", options.save_sightings,
                 "Write the points that were seen, to solve again without pictures")
      .TypeName("SIGHTINGS.yaml");
  command.AddOption("--out", options.out, "Calibration to write").Required().TypeName("CELL.yaml");
  command
      .AddOption(
          "--camera-info", options.camera_info,
          "Folder for camera.yaml and projector.yaml as camera_info_manager of ROS loads them")
      .TypeName("DIR");
  command
      .AddOption(
          "--report", options.report,
          "Folder for report.html with residuals, coverage, error field and parameters; also "
          "for a calibration that the verdict rejects")
      .TypeName("DIR");
  command.AddFlag("--force", options.force,
                  "Write a calibration that the verdict rejects; else an earlier one stays");
}

/// What the pictures gave, and the views that gave nothing.
struct Seen {
  SightingsFile file;
  std::vector<std::string> skipped;
  std::string camera_serial;
  std::string date;
};

Result<Seen> LookAtDataset(const CalibrateOptions& options, Session& session) {
  const auto stages = LoadSightingConfig(session);
  if (!stages) return Forward(stages);
  const auto target = LoadTarget(options.target);
  if (!target) return Forward(target);
  const auto scan = OpenUncalibratedScan(options.dataset);
  if (!scan) return Forward(scan);
  Seen seen;
  seen.file.target = *target;
  seen.file.camera_width = scan->calibration.camera.width;
  seen.file.camera_height = scan->calibration.camera.height;
  seen.file.projector_width = scan->sequence.width;
  seen.file.projector_height = scan->sequence.height;
  session.console.Begin("detect", static_cast<int>(scan->view_ids.size()));
  for (std::size_t i = 0; i < scan->view_ids.size(); ++i) {
    if (!session.console.Part(static_cast<int>(i))("detect", 0.0)) return Fail("{}", kCancelled);
    const int id = scan->view_ids[i];
    // A frame that cannot be read is an error; a picture without the target is not.
    const auto stack = ReadStack(*scan, id);
    if (!stack) return Forward(stack);
    if (seen.camera_serial.empty()) seen.camera_serial = stack->camera_id;
    if (seen.camera_serial != stack->camera_id && !stack->camera_id.empty()) {
      return Fail("{}: camera_id '{}' differs from '{}' of the views before", ViewFolder(*scan, id),
                  stack->camera_id, seen.camera_serial);
    }
    if (seen.date.empty()) seen.date = UtcDate(stack->frames.front().stamp_ns);
    auto sighting = SightTarget(*stack, *target, *stages, "view " + ViewName(id));
    if (sighting) {
      seen.file.sightings.push_back(std::move(*sighting));
    } else {
      seen.skipped.push_back(sighting.error().message);
    }
  }
  session.console.End();
  return seen;
}

Status CheckCommandLine(const CalibrateOptions& options) {
  if (options.dataset.empty() == options.sightings.empty()) {
    return Fail("exactly one of --dataset and --sightings is needed");
  }
  if (!options.dataset.empty() && options.target.empty()) {
    return Fail("--target: is required with --dataset");
  }
  return {};
}

Result<Seen> Look(const CalibrateOptions& options, Session& session) {
  if (!options.dataset.empty()) return LookAtDataset(options, session);
  auto file = LoadSightings(options.sightings);
  if (!file) return Forward(file);
  if (file->projector_width == 0) {
    return Fail("{}: states no projector, a cell has one", options.sightings);
  }
  return Seen{std::move(*file), {}, {}, {}};
}

void Print(const CellCalibrationResult& result, const std::vector<std::string>& skipped) {
  for (const std::string& reason : skipped) fmt::print("skipped: {}\n", reason);
  for (const PoseOutcome& pose : result.poses) {
    if (pose.used) {
      fmt::print("{}: {} points, rms {:.3f} px; {} in the projector, rms {:.3f} px\n", pose.name,
                 pose.num_points_camera, pose.rms_camera_px, pose.num_points_projector,
                 pose.rms_projector_px);
    } else {
      fmt::print("{}: left out: {}\n", pose.name, pose.reason);
    }
  }
  for (const RejectedPoint& point : result.rejected) {
    fmt::print("{}: point {} left out: {:.2f} px off in the {}\n",
               result.poses[static_cast<std::size_t>(point.sighting)].name, point.point,
               point.distance_px, point.in_projector ? "projector" : "camera");
  }
  const std::array<double, kNumCellParameters> values = CellParameterValues(result.calibration);
  for (int k = 0; k < kNumCellParameters; ++k) {
    const double sigma = std::sqrt(result.covariance(k, k));
    fmt::print("{} {:.7g} +- {:.2g}\n", CellParameterName(k), values[static_cast<std::size_t>(k)],
               sigma);
  }
  fmt::print("distortion: camera {}, projector {}\n", DistortionName(result.distortion_camera),
             DistortionName(result.distortion_projector));
  fmt::print("{}\n", result.verdict.words);
}

void SetFigures(const CellCalibrationResult& result, std::size_t num_skipped, Json& figures) {
  int num_used = 0;
  std::vector<Json> poses;
  for (const PoseOutcome& pose : result.poses) {
    num_used += pose.used ? 1 : 0;
    Json figure;
    figure.Set("name", pose.name)
        .Set("used", pose.used)
        .Set("reason", pose.reason)
        .Set("rms_camera_px", pose.rms_camera_px)
        .Set("rms_projector_px", pose.rms_projector_px)
        .Set("held_out_ratio", pose.held_out_ratio);
    poses.push_back(std::move(figure));
  }
  const std::array<double, kNumCellParameters> values = CellParameterValues(result.calibration);
  std::vector<Json> parameters;
  for (int k = 0; k < kNumCellParameters; ++k) {
    Json figure;
    figure.Set("name", CellParameterName(k))
        .Set("value", values[static_cast<std::size_t>(k)])
        .Set("sigma", std::sqrt(result.covariance(k, k)));
    parameters.push_back(std::move(figure));
  }
  figures.Set("accepted", result.verdict.accepted)
      .Set("verdict", result.verdict.words)
      .Set("num_poses", result.poses.size() + num_skipped)
      .Set("num_poses_used", num_used)
      .Set("num_points_rejected", result.rejected.size())
      .Set("rms_camera_px", result.rms_camera_px)
      .Set("rms_projector_px", result.rms_projector_px)
      .Set("rms_joint_px", result.rms_joint_px)
      .Set("sigma_scale_camera", result.sigma_scale_camera)
      .Set("sigma_scale_projector", result.sigma_scale_projector)
      .Set("condition", result.condition)
      .Set("predicted_error_m", result.next.error_before_m)
      .Set("distortion_camera", DistortionName(result.distortion_camera))
      .Set("distortion_projector", DistortionName(result.distortion_projector))
      .Set("coverage_camera_ratio", result.coverage.camera_ratio)
      .Set("coverage_projector_ratio", result.coverage.projector_ratio)
      .Set("max_tilt_deg", result.coverage.max_tilt_deg)
      .Set("calibration_id", CalibrationId(result.calibration))
      .Set("parameters", parameters)
      .Set("poses", poses);
}

Status Write(const CalibrateOptions& options, const CellCalibrationResult& result) {
  if (!options.camera_info.empty()) {
    const std::filesystem::path folder = options.camera_info;
    Status status = MakeFolder(options.camera_info);
    if (status) {
      status =
          WriteCameraInfo(result.calibration.camera, "camera", (folder / "camera.yaml").string());
    }
    if (status) {
      status = WriteCameraInfo(result.calibration.projector, "projector",
                               (folder / "projector.yaml").string());
    }
    if (!status) return status;
  }
  return WriteCalibratedCell(result, options.out);
}

Status WriteResultReport(const CalibrateOptions& options, const CellCalibrationResult& result,
                         const std::vector<std::string>& skipped) {
  if (options.report.empty()) return {};
  auto folder = StagedFolder::Create(options.report);
  if (!folder) return tl::unexpected(folder.error());
  if (Status status = WriteCalibrationReport(result, skipped, folder->path()); !status) {
    return status;
  }
  return folder->Commit();
}

Status Calibrate(const CalibrateOptions& options, Session& session) {
  if (Status status = CheckOutputFile(options.out, {".yaml"}); !status) return status;
  if (!options.save_sightings.empty()) {
    if (Status status = CheckOutputFile(options.save_sightings, {".yaml"}); !status) return status;
  }
  if (!options.dataset.empty()) session.AdoptSettings(options.dataset);
  const auto config = session.LoadStage<CalibrationConfig>("calibration");
  if (!config) return Forward(config);
  const auto seen = Look(options, session);
  if (!seen) return Forward(seen);
  const SightingsFile& file = seen->file;
  if (!options.save_sightings.empty()) {
    if (Status status = SaveSightings(file, options.save_sightings); !status) return status;
  }
  session.console.Begin("solve", 1);
  auto result = CalibrateCell(
      file.target, file.sightings,
      {file.camera_width, file.camera_height, file.projector_width, file.projector_height},
      *config);
  if (!result) {
    return Fail("{}{}{}", result.error().message,
                seen->skipped.empty() ? "" : "; skipped: ", fmt::join(seen->skipped, "; "));
  }
  session.console.End();
  result->calibration.camera_serial = seen->camera_serial;
  result->calibration.date = seen->date;
  Print(*result, seen->skipped);
  SetFigures(*result, seen->skipped.size(), session.figures);
  // A rejected calibration is what one wants to look at.
  if (Status status = WriteResultReport(options, *result, seen->skipped); !status) return status;
  if (!result->verdict.accepted && !options.force) {
    return Fail("{}: not written, {} (--force writes it all the same)", options.out,
                fmt::join(result->verdict.reasons, "; "));
  }
  return Write(options, *result);
}

}  // namespace

void AddCalibrate(Tool& tool) {
  AddCommand<CalibrateOptions>(
      tool, "calibrate",
      "Scans of a calibration target -> cell.yaml with covariance and a verdict in words", Declare,
      Calibrate, CheckCommandLine);
}

}  // namespace fringe_fusion::cli
