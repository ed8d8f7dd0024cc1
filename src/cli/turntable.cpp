// fringe turntable: a target or registered views at several angles of a turntable -> its axis.
#include <filesystem>

#include "command.hpp"
#include "common/constants.hpp"
#include "device_figures.hpp"
#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/device_files.hpp"
#include "fringe_fusion/registration/register_views.hpp"
#include "sighting_config.hpp"
#include "views.hpp"

namespace fringe_fusion::cli {
namespace {

namespace fs = std::filesystem;

struct TurntableOptions {
  std::string dataset;
  std::string views;
  std::string sightings;
  std::string stops;
  std::string target;
  std::string cell;
  int joint = 0;
  std::string out;
  std::string edges;
  std::string parent_frame = "cell";
  bool force = false;
};

void DeclareInput(Command& command, TurntableOptions& options) {
  const Option dataset =
      command
          .AddOption("--dataset", options.dataset,
                     "Scan folder whose views show the target at the stops of the table")
          .TypeName("SCAN/");
  const Option views = command
                           .AddOption("--views", options.views,
                                      "Instead: scan folder of a part that the table turns; its "
                                      "overlapping views are registered without their priors")
                           .Excludes(dataset)
                           .TypeName("SCAN/");
  command
      .AddOption("--sightings", options.sightings,
                 "Instead: points of the target that were seen before; needs --stops")
      .Excludes(dataset)
      .Excludes(views)
      .TypeName("SIGHTINGS.yaml");
  command
      .AddOption("--stops", options.stops,
                 "Angles by the names of the sightings or views (default: joint_positions of each "
                 "view.yaml)")
      .TypeName("STOPS.yaml");
  command.AddOption("--joint", options.joint, "Which of the joint_positions is the table")
      .AtLeastZero()
      .TypeName("N")
      .ShowDefault();
  command.AddOption("--target", options.target, "Description of the target")
      .Needs(dataset)
      .TypeName("TARGET.yaml");
  command
      .AddOption("--cell", options.cell,
                 "Lens models: a cell.yaml, or a file with `camera` alone (default: cell.yaml of "
                 "the scan)")
      .TypeName("CELL.yaml");
}

void Declare(Command& command, TurntableOptions& options) {
  DeclareInput(command, options);
  command.AddOption("--out", options.out, "Result with covariance and verdict")
      .Required()
      .TypeName("TURNTABLE.yaml");
  command
      .AddOption("--edges", options.edges,
                 "Edges of the tf tree, as scanner_node reads them, with the edge `scanner`: the "
                 "edge `turntable_base` is set, others stay")
      .TypeName("EDGES.yaml");
  command
      .AddOption("--parent-frame", options.parent_frame,
                 "Frame of the edges in which scanner and turntable are at rest")
      .TypeName("FRAME")
      .ShowDefault();
  command.AddFlag("--force", options.force,
                  "Write a result that the verdict rejects; else an earlier one stays");
}

/// Angle of one view by the joints of the table.
Result<TurntableStop> StopOfView(const ScanFolder& scan, int view_id, int joint,
                                 bool angles_known) {
  TurntableStop stop;
  stop.name = ViewName(view_id);
  const auto view = ReadViewDescription(scan, view_id);
  if (!view) return Forward(view);
  if (joint < static_cast<int>(view->joint_positions.size())) {
    stop.angle_rad = view->joint_positions[static_cast<std::size_t>(joint)];
  } else if (angles_known) {
    return Fail("{}: view.yaml has {} joint_positions, --joint {} asks for one more",
                ViewFolder(scan, view_id), view->joint_positions.size(), joint);
  }
  return stop;
}

Status CheckCommandLine(const TurntableOptions& options) {
  const int num_sources = static_cast<int>(!options.dataset.empty()) +
                          static_cast<int>(!options.views.empty()) +
                          static_cast<int>(!options.sightings.empty());
  if (num_sources != 1) return Fail("exactly one of --dataset, --views and --sightings is needed");
  if (!options.sightings.empty() && (options.stops.empty() || options.cell.empty())) {
    return Fail("--sightings needs --stops and --cell");
  }
  if (!options.dataset.empty() && options.target.empty()) {
    return Fail("--target: is required with --dataset");
  }
  return {};
}

Result<TurntableResult> FromSightings(const TurntableOptions& options,
                                      const TurntableConfig& config) {
  const auto stops = LoadTurntableStops(options.stops);
  if (!stops) return Forward(stops);
  const auto seen = LoadSightings(options.sightings);
  if (!seen) return Forward(seen);
  const auto devices = ReadRig(options.cell);
  if (!devices) return Forward(devices);
  std::vector<std::string> names;
  for (const TurntableStop& stop : *stops) names.push_back(stop.name);
  const auto ordered = SightingsOf(names, seen->sightings, options.sightings);
  if (!ordered) return Forward(ordered);
  return CalibrateTurntable(*stops, *ordered, TargetView{seen->target, *devices}, config);
}

/// Stops of the views, in their order.
Result<std::vector<TurntableStop>> StopsOfViews(const TurntableOptions& options,
                                                const ScanFolder& scan,
                                                const std::vector<int>& view_ids,
                                                const TurntableConfig& config) {
  std::vector<TurntableStop> given;
  if (!options.stops.empty()) {
    auto stops = LoadTurntableStops(options.stops);
    if (!stops) return Forward(stops);
    given = std::move(*stops);
  }
  std::vector<TurntableStop> stops;
  for (const int id : view_ids) {
    bool is_given = false;
    for (const TurntableStop& stop : given) {
      if (stop.name != ViewName(id)) continue;
      stops.push_back(stop);
      is_given = true;
    }
    if (is_given) continue;
    if (!given.empty()) return Fail("{}: has no stop named '{}'", options.stops, ViewName(id));
    auto stop = StopOfView(scan, id, options.joint, config.angles_known);
    if (!stop) return Forward(stop);
    stops.push_back(std::move(*stop));
  }
  return stops;
}

Result<TurntableResult> FromDataset(const TurntableOptions& options, const TurntableConfig& config,
                                    Session& session) {
  const auto stages = LoadSightingConfig(session);
  if (!stages) return Forward(stages);
  const auto target = LoadTarget(options.target);
  if (!target) return Forward(target);
  const auto devices = ReadRig(
      options.cell.empty() ? (fs::path(options.dataset) / "cell.yaml").string() : options.cell);
  if (!devices) return Forward(devices);
  const auto scan = OpenUncalibratedScan(options.dataset);
  if (!scan) return Forward(scan);
  std::vector<int> seen_ids;
  std::vector<TargetSighting> sightings;
  session.console.Begin("detect", static_cast<int>(scan->view_ids.size()));
  for (std::size_t i = 0; i < scan->view_ids.size(); ++i) {
    if (!session.console.Part(static_cast<int>(i))("detect", 0.0)) return Fail("{}", kCancelled);
    const int id = scan->view_ids[i];
    const auto stack = ReadStack(*scan, id);
    if (!stack) return Forward(stack);
    auto sighting = SightTarget(*stack, *target, *stages, ViewName(id));
    if (!sighting) {
      fmt::print("skipped: {}\n", sighting.error().message);
      continue;
    }
    seen_ids.push_back(id);
    sightings.push_back(std::move(*sighting));
  }
  session.console.End();
  const auto stops = StopsOfViews(options, *scan, seen_ids, config);
  if (!stops) return Forward(stops);
  return CalibrateTurntable(*stops, sightings, TargetView{*target, *devices}, config);
}

Result<TurntableResult> FromViews(const TurntableOptions& options, const TurntableConfig& config,
                                  Session& session) {
  auto registration = session.LoadStage<RegistrationConfig>("registration");
  if (!registration) return Forward(registration);
  // Priors of a turntable hold the axis that is asked for.
  registration->use_prior = false;
  const auto scan = OpenScan(options.views);
  if (!scan) return Forward(scan);
  const auto stops = StopsOfViews(options, *scan, scan->view_ids, config);
  if (!stops) return Forward(stops);
  ViewsOptions which;
  which.views = options.views;
  auto views = LoadViews(which, session);
  if (!views) return Forward(views);
  ViewGraph graph;
  graph.views = std::move(*views);
  session.console.Begin("register", 1);
  const auto registered = RegisterViews(graph, *registration, session.console.Part(0));
  if (!registered) return Fail("{}: {}", options.views, registered.error().message);
  session.console.End();
  std::vector<Pose> poses;
  std::vector<TurntableStop> connected;
  for (std::size_t i = 0; i < registered->views.size(); ++i) {
    const RegisteredView& view = registered->views[i];
    if (!view.connected) {
      fmt::print("skipped: view {} overlaps no other one\n", (*stops)[i].name);
      continue;
    }
    poses.push_back(view.pose);
    connected.push_back((*stops)[i]);
  }
  return CalibrateTurntable(connected, TargetPosesOfViews(poses), config);
}

Result<TurntableResult> FindAxis(const TurntableOptions& options, const TurntableConfig& config,
                                 Session& session) {
  if (!options.dataset.empty()) return FromDataset(options, config, session);
  if (!options.views.empty()) return FromViews(options, config, session);
  return FromSightings(options, config);
}

void Print(const TurntableResult& result) {
  PrintOutcomes(result.stops);
  const Eigen::Vector3d& p = result.point_camera;
  const Eigen::Vector3d& d = result.direction_camera;
  fmt::print(
      "axis in the camera's frame: point {:.6f} {:.6f} {:.6f} m +- {:.4f} mm, direction {:.8f} "
      "{:.8f} {:.8f} +- {:.5f} deg\n",
      p.x(), p.y(), p.z(), 1e3 * result.sigma_point_m, d.x(), d.y(), d.z(),
      kDegPerRad * result.sigma_direction_rad);
  fmt::print("{}\n", result.verdict.words);
}

void SetFigures(const TurntableResult& result, Json& figures) {
  int num_used = 0;
  for (const DevicePoseOutcome& stop : result.stops) num_used += stop.used ? 1 : 0;
  figures.Set("accepted", result.verdict.accepted)
      .Set("verdict", result.verdict.words)
      .Set("num_stops", result.stops.size())
      .Set("num_stops_used", num_used)
      .Set("T_camera_base", PoseFigure(result.T_camera_base, result.covariance_base))
      .Set("sigma_direction_deg", kDegPerRad * result.sigma_direction_rad)
      .Set("sigma_point_m", result.sigma_point_m)
      .Set("arc_deg", result.arc_deg)
      .Set("condition", result.condition)
      .Set("sigma_scale_table", result.sigma_scale_table)
      .Set("sigma_scale_target", result.sigma_scale_target)
      .Set("rms_px", result.rms_px)
      .Set("rms_miss_m", result.rms_miss_m)
      .Set("stops", OutcomeFigures(result.stops));
}

/// The edge needs to know where the scanner is.
Status SetEdge(const TurntableOptions& options, const TurntableResult& result) {
  auto edges = ReadFrameEdges(options.edges);
  if (!edges) return Forward(edges);
  for (const FrameEdge& edge : *edges) {
    if (edge.child_frame != "scanner" || edge.parent_frame != options.parent_frame) continue;
    SetFrameEdge(TurntableBaseEdge(result, edge.T_parent_child, options.parent_frame, *edges),
                 *edges);
    return WriteFrameEdges(*edges, options.edges);
  }
  return Fail("{}: has no edge from {} to scanner, by which the axis is placed", options.edges,
              options.parent_frame);
}

Status Turntable(const TurntableOptions& options, Session& session) {
  for (const std::string& file : {options.out, options.edges}) {
    if (file.empty()) continue;
    if (Status status = CheckOutputFile(file, {".yaml"}); !status) return status;
  }
  for (const std::string& scan : {options.dataset, options.views}) {
    if (!scan.empty()) session.AdoptSettings(scan);
  }
  const auto config = session.LoadStage<TurntableConfig>("turntable");
  if (!config) return Forward(config);
  const auto result = FindAxis(options, *config, session);
  if (!result) return Forward(result);
  Print(*result);
  SetFigures(*result, session.figures);
  if (!result->verdict.accepted && !options.force) return NotWritten(options.out, result->verdict);
  if (Status status = WriteTurntable(*result, options.out); !status) return status;
  if (options.edges.empty()) return {};
  return SetEdge(options, *result);
}

}  // namespace

void AddTurntable(Tool& tool) {
  AddCommand<TurntableOptions>(tool, "turntable",
                               "A target or views at several angles of a turntable -> its axis "
                               "with covariance and a verdict",
                               Declare, Turntable, CheckCommandLine);
}

}  // namespace fringe_fusion::cli
