// fringe pose: the pose of camera and projector from their codes, held against the calibration.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include "command.hpp"
#include "fringe_fusion/inspection/picture.hpp"
#include "fringe_fusion/inspection/report.hpp"
#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/image_io.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/pose/epipolar_health.hpp"
#include "fringe_fusion/pose/relative_pose.hpp"
#include "pose_figures.hpp"
#include "staged_folder.hpp"
#include "views.hpp"

namespace fringe_fusion::cli {
namespace {

struct PoseOptions {
  std::string scan;
  std::string out;
  int view = -1;
};

struct PoseSettings {
  DecodeConfig decode;
  EpipolarConfig epipolar;
  HealthConfig health;
};

/// What the views of a scan say together.
struct PoseResult {
  RelativePose pose;
  bool used_prior = false;           ///< the calibration decided between the two poses of a plane
  std::vector<HealthReport> health;  ///< per view
  Drift drift;
};

void Declare(Command& command, PoseOptions& options) {
  command.AddOption("--scan", options.scan, "Scan folder with cell.yaml, patterns.yaml, views/")
      .Required()
      .TypeName("SCAN/");
  command.AddOption("--view", options.view, "Only this view (default: all)")
      .AtLeastZero()
      .TypeName("K");
  command
      .AddOption("--out", options.out,
                 "Write report.html, pictures of the residuals and cell.yaml with the pose found")
      .TypeName("DIR");
}

Result<PoseSettings> LoadSettings(const Session& session) {
  const auto decode = LoadDecodeConfig(session);
  if (!decode) return Forward(decode);
  const auto epipolar = session.LoadStage<EpipolarConfig>("epipolar");
  if (!epipolar) return Forward(epipolar);
  const auto health = session.LoadStage<HealthConfig>("health");
  if (!health) return Forward(health);
  return PoseSettings{*decode, *epipolar, *health};
}

/// Decodes every view, judges it, and collects its matches.
Result<std::vector<Match>> ReadMatches(const ScanFolder& scan, const std::vector<int>& ids,
                                       const PoseSettings& settings, Session& session,
                                       PoseResult& result) {
  std::vector<Match> all;
  HealthHistory history;
  session.console.Begin("decode", static_cast<int>(ids.size()));
  for (const int id : ids) {
    const Progress progress = session.console.Part(static_cast<int>(result.health.size()));
    const auto stack = ReadStack(scan, id);
    if (!stack) return Forward(stack);
    const auto phase = DecodeView(*stack, settings.decode, ViewFolder(scan, id), progress);
    if (!phase) return Forward(phase);
    const auto matches = SampleMatches(*phase, settings.epipolar.max_matches);
    if (!matches) return Fail("{}: {}", ViewFolder(scan, id), matches.error().message);
    all.insert(all.end(), matches->begin(), matches->end());
    auto health = CheckHealth(*phase, scan.calibration, settings.epipolar, settings.health);
    if (!health) return Fail("{}: {}", ViewFolder(scan, id), health.error().message);
    history.Add(phase->first_stamp_ns, *health, scan.calibration);
    result.health.push_back(std::move(*health));
  }
  session.console.End();
  result.drift = history.Fit(settings.health);
  return all;
}

/// The pose from the codes alone; only a flat scene asks the calibration which of two it is.
Status EstimatePose(const ScanFolder& scan, const std::vector<Match>& matches,
                    const EpipolarConfig& config, PoseResult& result) {
  const DevicePair devices{scan.calibration.camera, scan.calibration.projector};
  auto pose = EstimateRelativePose(matches, devices, config);
  if (!pose) {
    const std::string reason = pose.error().message;
    pose = EstimateRelativePose(matches, devices, config, scan.calibration.T_projector_camera);
    if (!pose) return Fail("{}: {}", scan.path, reason);
    result.used_prior = true;
  }
  result.pose = *pose;
  return {};
}

/// Colours from blue to red over +- limit; invalid pixels are grey.
Image<Rgb8> ResidualPicture(const Image<float>& residual_px, double limit_px) {
  const std::vector<float> values(residual_px.begin(), residual_px.end());
  const std::vector<Rgb8> colors = DeviationColors(values, limit_px);
  Image<Rgb8> picture(residual_px.width(), residual_px.height());
  std::copy(colors.begin(), colors.end(), picture.begin());
  return picture;
}

Status WriteResult(const PoseOptions& options, const ScanFolder& scan, const std::vector<int>& ids,
                   const PoseSettings& settings, const PoseResult& result) {
  auto folder = StagedFolder::Create(options.out);
  if (!folder) return Forward(folder);
  const std::filesystem::path path = folder->path();
  Report report;
  report.title = "Pose of camera and projector";
  report.paragraphs.push_back(result.drift.message);
  report.tables.push_back(PoseTable(result.pose, scan.calibration));
  report.tables.push_back(HealthTable(ids, result.health));
  const double limit_px = 3.0 * settings.health.warn_px;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const std::string file = fmt::format("residual_{}.png", ViewName(ids[i]));
    const Image<Rgb8> picture = ResidualPicture(result.health[i].residual_px, limit_px);
    if (Status status = WriteImage(picture, (path / file).string()); !status) return status;
    report.pictures.push_back(
        {fmt::format("View {}: signed distance to the epipolar line, blue -{:.2g} px to red "
                     "+{:.2g} px, grey: no code",
                     ids[i], limit_px, limit_px),
         file});
  }
  CellCalibration found = scan.calibration;
  const double baseline_m = scan.calibration.T_projector_camera.translation().norm();
  found.T_projector_camera = result.pose.T_observed_anchor;
  found.T_projector_camera.translation() *= baseline_m;
  if (Status status = WriteCellCalibration(found, (path / "cell.yaml").string()); !status) {
    return status;
  }
  if (Status status = WriteReport(report, (path / "report.html").string()); !status) return status;
  return folder->Commit();
}

Status Pose(const PoseOptions& options, Session& session) {
  session.AdoptSettings(options.scan);
  const auto settings = LoadSettings(session);
  if (!settings) return Forward(settings);
  const auto scan = OpenScan(options.scan);
  if (!scan) return Forward(scan);
  const auto ids = SelectViews(*scan, options.view);
  if (!ids) return Forward(ids);
  PoseResult result;
  const auto matches = ReadMatches(*scan, *ids, *settings, session, result);
  if (!matches) return Forward(matches);
  session.console.Begin("pose", 1);
  if (Status status = EstimatePose(*scan, *matches, settings->epipolar, result); !status) {
    return status;
  }
  session.console.End();
  session.figures.Set("calibration_id", CalibrationId(scan->calibration));
  session.figures.Set(
      "pose",
      PoseFigures(result.pose, scan->calibration).Set("decided_by_calibration", result.used_prior));
  std::vector<Json> views;
  for (std::size_t i = 0; i < ids->size(); ++i) {
    views.push_back(HealthFigures((*ids)[i], result.health[i]));
  }
  session.figures.Set("health", views);
  session.figures.Set("drift", DriftFigures(result.drift));
  const RelativePose& pose = result.pose;
  fmt::print("{} matches, {} inliers, median distance to the epipolar line {:.3f} px\n",
             pose.num_matches, pose.num_inliers, pose.median_residual_px);
  fmt::print("against the calibration: {:.4f} deg rotation, {:.4f} deg direction of the baseline\n",
             RotationDeg(pose, scan->calibration), DirectionDeg(pose, scan->calibration));
  for (std::size_t i = 0; i < ids->size(); ++i) {
    fmt::print("view {}: {}: {}\n", (*ids)[i], HealthLevelName(result.health[i].level),
               result.health[i].message);
  }
  if (options.out.empty()) return {};
  return WriteResult(options, *scan, *ids, *settings, result);
}

}  // namespace

void AddPose(Tool& tool) {
  AddCommand<PoseOptions>(tool, "pose",
                          "Pose of camera and projector from the codes alone, and the health of "
                          "the calibration",
                          Declare, Pose);
}

}  // namespace fringe_fusion::cli
