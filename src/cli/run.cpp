// fringe run: a scan folder -> range images, poses, mesh and report.
#include <filesystem>
#include <optional>
#include <utility>

#include "capture_figures.hpp"
#include "command.hpp"
#include "figures.hpp"
#include "fill_option.hpp"
#include "fringe_fusion/inspection/picture.hpp"
#include "fringe_fusion/inspection/report.hpp"
#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/image_io.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/io/poses_conf.hpp"
#include "fringe_fusion/registration/register_views.hpp"
#include "fuse_views.hpp"
#include "staged_folder.hpp"
#include "views.hpp"

namespace fringe_fusion::cli {
namespace {

namespace fs = std::filesystem;

struct RunOptions {
  std::string scan;
  std::string out;
  double voxel_m = 0.0;
  bool keep_priors = false;
  FillOptions fill;
};

/// Settings of every stage of the run.
struct RunConfig {
  ReconstructConfig reconstruct;
  RegistrationConfig registration;
  FuseConfig fuse;
  std::optional<FillConfig> fill;  ///< none: holes stay open
};

/// What the stages hand on, and the page that tells of them.
struct Work {
  ScanFolder scan;
  RunConfig config;
  fs::path folder;  ///< where results are written
  std::vector<View> views;
  std::vector<ViewDiagnosis> captures;
  Report report;
  std::string summary;  ///< the line that ends the command
};

void Declare(Command& command, RunOptions& options) {
  command.AddOption("--scan", options.scan, "Scan folder with cell.yaml, patterns.yaml, views/")
      .Required()
      .TypeName("SCAN/");
  command
      .AddOption("--out", options.out,
                 "Folder for mesh.ply, cloud.ply, views/NNN/range.ply, poses.conf, mesh.png, "
                 "phase.png and report.html; earlier results are replaced only when all is done")
      .Required()
      .TypeName("DIR");
  command
      .AddOption("--voxel", options.voxel_m,
                 "Edge of a voxel [m] (default: fusion.yaml of --config, else the median distance "
                 "of neighbouring points)")
      .InRange(1e-6, 10.0)
      .TypeName("M");
  command.AddFlag("--no-registration", options.keep_priors,
                  "Fuse at the prior poses instead of registering the views");
  DeclareFill(command, options.fill);
}

Result<RunConfig> LoadConfigs(const RunOptions& options, const Session& session) {
  const auto reconstruct = LoadReconstructConfig(session);
  if (!reconstruct) return Forward(reconstruct);
  const auto registration = session.LoadStage<RegistrationConfig>("registration");
  if (!registration) return Forward(registration);
  const auto fuse = LoadFuseConfig(session, options.voxel_m);
  if (!fuse) return Forward(fuse);
  const auto fill = LoadFillConfig(options.fill, session);
  if (!fill) return Forward(fill);
  return RunConfig{*reconstruct, *registration, *fuse, *fill};
}

/// The two sides of a phase map: the projector column where it was coded, else the row.
Status WritePhasePicture(Work& work, int view_id, const PhaseMap& phase) {
  const Image<float>& coordinate = phase.u.empty() ? phase.v : phase.u;
  work.report.pictures.push_back({fmt::format("Projector {} seen by each camera pixel, view {}",
                                              phase.u.empty() ? "row" : "column", view_id),
                                  "phase.png"});
  return WriteImage(RenderScalar(coordinate, "px"), (work.folder / "phase.png").string());
}

/// Frames of one view -> range image, after a look at the frames: where they yield nothing, the
/// finding says why.
Result<Reconstruction> ExamineAndReconstruct(Work& work, int view_id, const Progress& progress) {
  const ReconstructConfig& config = work.config.reconstruct;
  const auto stack = ReadStack(work.scan, view_id);
  if (!stack) return Forward(stack);
  work.captures.push_back({view_id, DiagnoseStack(*stack, config.decode.phase,
                                                  config.decode.diagnosis, work.scan.calibration)});
  auto made = ReconstructStack(work.scan, *stack, config, progress);
  const Result<Diagnosis>& diagnosis = work.captures.back().diagnosis;
  if (made || !diagnosis || diagnosis->findings.empty()) return made;
  const Finding& cause = diagnosis->findings.front();
  return Fail("{}; capture: {}: {}; {}", made.error().message, FindingName(cause.kind),
              cause.evidence, cause.advice);
}

/// What the frames said about their capture. Findings never stop a run.
void ReportCapture(Work& work, Session& session) {
  std::vector<Json> figures;
  for (const ViewDiagnosis& view : work.captures) figures.push_back(DiagnosisFigures(view));
  session.figures.Set("capture", figures);
  work.report.tables.push_back(CaptureTable(work.captures));
}

Status ReconstructViews(Work& work, Session& session) {
  Report::Table table;
  table.title = "Views";
  table.header = {"view", "points", "median sigma along the ray [mm]", "median epipolar [px]"};
  std::vector<Json> figures;
  std::vector<std::string> names;
  std::vector<ReasonCount> masks;
  session.console.Begin("reconstruct", static_cast<int>(work.scan.view_ids.size()));
  for (const int id : work.scan.view_ids) {
    const Progress progress = session.console.Part(static_cast<int>(figures.size()));
    const auto pose = PriorPose(work.scan, id);
    if (!pose) return tl::unexpected(pose.error());
    auto made = ExamineAndReconstruct(work, id, progress);
    if (!made) return tl::unexpected(made.error());
    if (figures.empty()) {
      if (Status status = WritePhasePicture(work, id, made->phase); !status) return status;
    }
    const fs::path file = work.folder / RangeFile(id);
    if (Status status = MakeFolder(file.parent_path().string()); !status) return status;
    if (Status status = WriteRangeImage(made->triangulation.range, file.string()); !status) {
      return status;
    }
    figures.push_back(RangeFigures(id, made->triangulation));
    names.push_back(ViewName(id));
    masks.push_back(CountReasons(made->triangulation.mask));
    table.rows.push_back(
        {names.back(), std::to_string(CountValid(made->triangulation.range)),
         fmt::format("{:.4f}", Median(made->triangulation.range.sigma_range) * 1e3),
         fmt::format("{:.3f}", made->triangulation.median_abs_epipolar_px)});
    work.views.push_back({id, ViewName(id), std::move(made->triangulation.range), *pose});
    if (Status status = Validate(work.views.back()); !status) return status;
  }
  session.console.End();
  session.figures.Set("views", figures);
  work.report.tables.push_back(std::move(table));
  work.report.tables.push_back(MaskTable(names, masks));
  ReportCapture(work, session);
  return {};
}

Status RegisterAll(Work& work, Session& session) {
  ViewGraph graph;
  graph.views = std::move(work.views);
  session.console.Begin("register", 1);
  const auto result = RegisterViews(graph, work.config.registration, session.console.Part(0));
  work.views = std::move(graph.views);
  if (!result) return Fail("{}: {}", work.scan.path, result.error().message);
  session.console.End();
  for (std::size_t i = 0; i < work.views.size(); ++i) work.views[i].pose = result->views[i].pose;
  session.figures.Set("registration", RegistrationFigures(*result));
  work.report.tables.push_back(RegistrationTable(*result));
  if (!result->warnings.empty()) {
    Report::Table table;
    table.title = "Registration: what to look at";
    table.header = {"warning"};
    for (const std::string& warning : result->warnings) table.rows.push_back({warning});
    work.report.tables.push_back(std::move(table));
  }
  work.summary = fmt::format(", registration rms {:.4f} mm", result->rms_after_m * 1e3);
  return {};
}

Status WritePoses(const Work& work) {
  std::vector<ConfEntry> entries;
  for (const View& view : work.views) {
    entries.push_back({RangeFile(view.id), view.pose.T_object_camera});
  }
  return WritePosesConf(entries, (work.folder / "poses.conf").string());
}

/// All points of all views in the object frame.
Status WriteCloud(const Work& work, Session& session) {
  Mesh all;
  for (const View& view : work.views) {
    const Eigen::Isometry3f T_object_camera = view.pose.T_object_camera.cast<float>();
    const Mesh cloud = ToCloud(view.range);
    for (const Eigen::Vector3f& point : cloud.vertices) {
      all.vertices.push_back(T_object_camera * point);
    }
    for (const Eigen::Vector3f& normal : cloud.normals) {
      all.normals.push_back(T_object_camera.linear() * normal);
    }
    all.colors.insert(all.colors.end(), cloud.colors.begin(), cloud.colors.end());
    all.sigma.insert(all.sigma.end(), cloud.sigma.begin(), cloud.sigma.end());
  }
  session.figures.Set("num_cloud_points", all.vertices.size());
  return WriteMesh(all, (work.folder / "cloud.ply").string());
}

Status FuseAll(Work& work, Session& session) {
  auto fused = FuseToMesh(work.views, work.config.fuse, session);
  if (!fused) return Fail("{}: {}", work.scan.path, fused.error().message);
  work.report.tables.push_back(PointTable(fused->figures));
  if (work.config.fill) {
    auto filled = FillMesh(*work.config.fill, fused->model, work.views, session);
    if (!filled) return Fail("{}: {}", work.scan.path, filled.error().message);
    fused->mesh = std::move(filled->mesh);
    work.report.tables.push_back(FillTable(filled->figures));
  }
  const Mesh& mesh = fused->mesh;
  work.summary = FusionSummary(*fused) + work.summary;
  work.report.tables.push_back(MeshTable(mesh));
  if (Status status = WriteMesh(mesh, (work.folder / "mesh.ply").string()); !status) return status;
  // A single view is best seen from its camera, a whole object obliquely from above.
  const Eigen::Vector3f direction =
      work.views.size() == 1
          ? Eigen::Vector3f(-work.views[0].pose.T_object_camera.linear().col(2).cast<float>())
          : Eigen::Vector3f(0.6F, -0.7F, 0.4F);
  const auto picture = RenderMesh(mesh, direction, 1000, 800, !mesh.colors.empty());
  if (!picture) return Forward(picture);
  work.report.pictures.insert(work.report.pictures.begin(), {"The mesh", "mesh.png"});
  return WriteImage(*picture, (work.folder / "mesh.png").string());
}

Status AllStages(const RunOptions& options, Work& work, Session& session) {
  work.report.title = "Scan";
  work.report.paragraphs = {fmt::format("{} views, calibration {}. Lengths are metres in files.",
                                        work.scan.view_ids.size(),
                                        CalibrationId(work.scan.calibration))};
  if (Status status = ReconstructViews(work, session); !status) return status;
  if (work.views.size() == 1) {
    const auto description = ReadViewDescription(work.scan, work.views[0].id);
    if (description && !description->prior) {
      work.report.paragraphs.emplace_back(
          "The view has no prior pose: the camera frame is the object frame.");
    }
  } else if (options.keep_priors) {
    work.report.paragraphs.emplace_back("The views were fused at their prior poses.");
  } else {
    if (Status status = RegisterAll(work, session); !status) return status;
  }
  if (Status status = WritePoses(work); !status) return status;
  if (Status status = WriteCloud(work, session); !status) return status;
  if (Status status = FuseAll(work, session); !status) return status;
  return WriteReport(work.report, (work.folder / "report.html").string());
}

Status Run(const RunOptions& options, Session& session) {
  session.AdoptSettings(options.scan);
  auto config = LoadConfigs(options, session);
  if (!config) return tl::unexpected(config.error());
  auto scan = OpenScan(options.scan);
  if (!scan) return tl::unexpected(scan.error());
  if (const auto ids = SelectViews(*scan, -1); !ids) return tl::unexpected(ids.error());
  auto folder = StagedFolder::Create(options.out);
  if (!folder) return tl::unexpected(folder.error());
  Work work{std::move(*scan), std::move(*config), folder->path(), {}, {}, {}, {}};
  if (Status status = AllStages(options, work, session); !status) return status;
  session.figures.Set("calibration_id", CalibrationId(work.scan.calibration));
  if (Status status = folder->Commit(); !status) return status;
  fmt::print("{}: {}\n", (fs::path(options.out) / "mesh.ply").string(), work.summary);
  if (const std::size_t count = CountFindings(work.captures); count > 0) {
    fmt::print("{}: {} findings about the capture, see the section Capture\n",
               (fs::path(options.out) / "report.html").string(), count);
  }
  return {};
}

}  // namespace

void AddRun(Tool& tool) {
  AddCommand<RunOptions>(tool, "run", "All stages: a scan folder -> mesh and report", Declare, Run);
}

}  // namespace fringe_fusion::cli
