#include "views.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

#include "figures.hpp"
#include "fringe_fusion/diagnosis/sensor_noise.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/io/poses_conf.hpp"
#include "fringe_fusion/io/response_yaml.hpp"

namespace fringe_fusion::cli {
namespace {

namespace fs = std::filesystem;

/// What a foreign scanner's file leaves open: direction of the rays, noise, normals.
RangeImage Complete(RangeImage range, const ViewsOptions& options,
                    const TriangulationConfig& config) {
  // Files of our own name their devices; foreign scans are taken as parallel projections.
  if (!range.line_of_sight.projector && !range.line_of_sight.directional) {
    range.line_of_sight.directional = true;
    range.line_of_sight.camera =
        Eigen::Vector3d(options.line_of_sight.data()).normalized().cast<float>();
  }
  const auto sigma_m = static_cast<float>(options.sigma_mm * 1e-3);
  bool has_normals = true;
  for (std::size_t i = 0; i < range.points.size(); ++i) {
    if (!range.points[i].allFinite()) continue;
    if (!std::isfinite(range.sigma_range[i])) range.sigma_range[i] = sigma_m;
    if (!std::isfinite(range.sigma_lateral[i])) range.sigma_lateral[i] = sigma_m;
    has_normals = has_normals && range.normals[i].allFinite();
  }
  return has_normals ? range : EstimateNormals(range, config);
}

Result<ViewList> ListConf(const ViewsOptions& options, const Session& session) {
  const auto config = session.LoadStage<TriangulationConfig>("triangulation");
  if (!config) return Forward(config);
  const auto entries = ReadPosesConf(options.views);
  if (!entries) return Forward(entries);
  if (entries->empty()) return Fail("{}: names no scan", options.views);
  const auto read = [options, config = *config, entries = *entries](
                        int index, const Progress& /*progress*/) -> Result<View> {
    const ConfEntry& entry = entries[static_cast<std::size_t>(index)];
    const fs::path file = fs::path(options.views).parent_path() / entry.file;
    std::error_code error;
    // A scan of the live cell holds its frames only.
    if (!fs::exists(file, error) && fs::exists(file.parent_path() / "view.yaml", error)) {
      return Fail("{}: names {}, which is not there yet: `fringe reconstruct --scan {}` writes it",
                  options.views, file.string(),
                  file.parent_path().parent_path().parent_path().string());
    }
    Result<RangeImage> range = ReadRangeImage(file.string());
    if (!range) return Forward(range);
    View view;
    view.id = index;
    view.name = entry.file;
    view.range = Complete(std::move(*range), options, config);
    view.pose.T_object_camera = entry.T_object_camera;
    view.pose.source = PoseSource::kFile;
    return view;
  };
  return ViewList{static_cast<int>(entries->size()), read};
}

Result<RangeImage> LoadOrReconstruct(const ScanFolder& scan, int view_id,
                                     const ReconstructConfig& config, const Progress& progress) {
  const std::string file = (fs::path(scan.path) / RangeFile(view_id)).string();
  if (!fs::exists(file)) {
    Result<Reconstruction> made = ReconstructView(scan, view_id, config, progress);
    if (!made) return Forward(made);
    return std::move(made->triangulation.range);
  }
  return ReadRangeImage(file);
}

Result<ViewList> ListScan(const ViewsOptions& options, const Session& session) {
  const auto config = LoadReconstructConfig(session);
  if (!config) return Forward(config);
  const auto scan = OpenScan(options.views);
  if (!scan) return Forward(scan);
  const auto ids = SelectViews(*scan, -1);
  if (!ids) return Forward(ids);
  const auto read = [options, config = *config, scan = *scan, ids = *ids](
                        int index, const Progress& progress) -> Result<View> {
    const int id = ids[static_cast<std::size_t>(index)];
    Result<Pose> pose = Pose{};
    pose->source = PoseSource::kFile;
    if (!options.no_prior) pose = PriorPose(scan, id);
    if (!pose) return Forward(pose);
    Result<RangeImage> range = LoadOrReconstruct(scan, id, config, progress);
    if (!range) return Forward(range);
    return View{id, ViewName(id), std::move(*range), *pose};
  };
  return ViewList{static_cast<int>(ids->size()), read};
}

}  // namespace

void DeclareViews(Command& command, ViewsOptions& options) {
  command
      .AddOption("--views", options.views,
                 "POSES.conf (lines `bmesh FILE tx ty tz qx qy qz qw`) or a scan folder, whose "
                 "views without range.ply are reconstructed from their frames")
      .Required()
      .TypeName("POSES.conf|SCAN/");
  command
      .AddOption("--line-of-sight", options.line_of_sight,
                 "Direction to the sensor of directional scans in their own frame")
      .Delimiter(',')
      .TypeName("x,y,z")
      .ShowDefault();
  command
      .AddOption("--sigma-mm", options.sigma_mm,
                 "Standard deviation of the points of scans that state none [mm]")
      .InRange(1e-6, 1e3)
      .TypeName("MM")
      .ShowDefault();
}

Result<DecodeConfig> LoadDecodeConfig(const Session& session) {
  const auto phase = session.LoadStage<PhaseConfig>("phase");
  if (!phase) return Forward(phase);
  const auto diagnosis = session.LoadStage<DiagnosisConfig>("diagnosis");
  if (!diagnosis) return Forward(diagnosis);
  DecodeConfig config{*phase, *diagnosis, {}};
  if (!session.HasStage("response")) return config;
  auto response = ReadResponse(session.StageFile("response"));
  if (!response) return Forward(response);
  const auto pattern = session.LoadStage<PatternConfig>("pattern");
  if (!pattern) return Forward(pattern);
  if (response->use == ResponseUse::kPhase && pattern->gamma != 1.0) {
    return Fail("{}: gamma is {}, but response.yaml beside it is undone in the phases",
                session.StageFile("pattern"), pattern->gamma);
  }
  config.response = std::move(*response);
  return config;
}

Result<PhaseMap> DecodeView(const ImageStack& stack, const DecodeConfig& config,
                            const std::string& owner, const Progress& progress, PhaseMap recycled) {
  const auto phase = WithSensorNoise(config.phase, stack, config.diagnosis);
  if (!phase) return Fail("{}: {}", owner, phase.error().message);
  Result<PhaseMap> map = DecodeWithResponse(stack, *phase, config.diagnosis, config.response,
                                            progress, std::move(recycled));
  if (!map) return Fail("{}: {}", owner, map.error().message);
  return map;
}

Result<ReconstructConfig> LoadReconstructConfig(const Session& session) {
  const auto decode = LoadDecodeConfig(session);
  if (!decode) return Forward(decode);
  const auto triangulation = session.LoadStage<TriangulationConfig>("triangulation");
  if (!triangulation) return Forward(triangulation);
  return ReconstructConfig{*decode, *triangulation};
}

Result<Reconstruction> ReconstructView(const ScanFolder& scan, int view_id,
                                       const ReconstructConfig& config, const Progress& progress) {
  const Result<ImageStack> stack = ReadStack(scan, view_id);
  if (!stack) return Forward(stack);
  return ReconstructStack(scan, *stack, config, progress);
}

Result<Reconstruction> ReconstructStack(const ScanFolder& scan, const ImageStack& stack,
                                        const ReconstructConfig& config, const Progress& progress) {
  const std::string owner = ViewFolder(scan, stack.view_id);
  const auto half = [&progress](double begin) {
    return [&progress, begin](const std::string& stage, double fraction) {
      return progress(stage, begin + 0.5 * fraction);
    };
  };
  Result<PhaseMap> phase = DecodeView(stack, config.decode, owner, half(0.0));
  if (!phase) return Forward(phase);
  auto triangulation = Triangulate(*phase, scan.calibration, config.triangulation, half(0.5));
  if (!triangulation) {
    return Fail("{}: {}", owner, triangulation.error().message);
  }
  if (CountValid(triangulation->range) == 0) {
    return Fail("{}: has no valid point; pixels: {}", owner, ReasonCounts(triangulation->mask));
  }
  return Reconstruction{std::move(*phase), std::move(*triangulation)};
}

Result<Pose> PriorPose(const ScanFolder& scan, int view_id) {
  const auto description = ReadViewDescription(scan, view_id);
  if (!description) return Forward(description);
  if (description->prior) return *description->prior;
  if (scan.view_ids.size() == 1) {
    Pose pose;
    pose.source = PoseSource::kFile;
    return pose;
  }
  return Fail("{}: view {} has no pose: view.yaml needs `prior` when a scan has several views",
              scan.path, view_id);
}

Result<std::vector<int>> SelectViews(const ScanFolder& scan, int view_id) {
  if (scan.view_ids.empty()) return Fail("{}: has no views", scan.path);
  if (view_id < 0) return scan.view_ids;
  if (std::find(scan.view_ids.begin(), scan.view_ids.end(), view_id) == scan.view_ids.end()) {
    return Fail("{}: has no view {} (views {} to {})", scan.path, view_id, scan.view_ids.front(),
                scan.view_ids.back());
  }
  return std::vector<int>{view_id};
}

std::string ViewName(int view_id) { return fmt::format("{:03}", view_id); }

std::string RangeFile(int view_id) { return "views/" + ViewName(view_id) + "/range.ply"; }

Result<ViewList> ListViews(const ViewsOptions& options, const Session& session) {
  const Eigen::Vector3d direction(options.line_of_sight.data());
  if (!direction.allFinite() || !(direction.norm() > 1e-9)) {
    return Fail("--line-of-sight {},{},{}: must be a direction", direction.x(), direction.y(),
                direction.z());
  }
  if (!fs::exists(options.views)) return Fail("--views {}: does not exist", options.views);
  return fs::is_directory(options.views) ? ListScan(options, session) : ListConf(options, session);
}

Result<std::vector<View>> LoadViews(const ViewsOptions& options, Session& session) {
  const auto list = ListViews(options, session);
  if (!list) return Forward(list);
  std::vector<View> views;
  session.console.Begin("load", list->count);
  for (int i = 0; i < list->count; ++i) {
    const Progress progress = session.console.Part(i);
    if (!progress("load", 0.0)) return Fail("{}", kCancelled);
    Result<View> view = list->read(i, progress);
    if (!view) return Forward(view);
    if (Status status = Validate(*view); !status) return tl::unexpected(status.error());
    views.push_back(std::move(*view));
  }
  session.console.End();
  return views;
}

}  // namespace fringe_fusion::cli
