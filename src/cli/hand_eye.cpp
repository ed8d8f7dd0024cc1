// fringe hand-eye: pictures or sightings of a target and robot poses -> where the robot (or its
// base) carries the camera, with covariance and a verdict.
#include <filesystem>

#include "command.hpp"
#include "common/constants.hpp"
#include "device_figures.hpp"
#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/device_files.hpp"
#include "fringe_fusion/io/image_io.hpp"
#include "sighting_config.hpp"

namespace fringe_fusion::cli {
namespace {

namespace fs = std::filesystem;

struct HandEyeOptions {
  std::string dataset;
  std::string poses;
  std::string sightings;
  std::string target;
  std::string cell;
  std::string save_sightings;
  std::string out;
  std::string edges;
  std::string flange_frame = "tool0";
  std::string base_frame = "cell";
  bool force = false;
};

void DeclareInput(Command& command, HandEyeOptions& options) {
  const Option dataset =
      command
          .AddOption("--dataset", options.dataset,
                     "Folder with robot_poses.yaml, which names a picture or a view for each "
                     "pose, target.yaml and cell.yaml; without the projector's codes its camera "
                     "alone counts")
          .TypeName("DIR/");
  const Option poses = command
                           .AddOption("--poses", options.poses,
                                      "Instead of a data set: robot poses, whose names are those "
                                      "of the sightings")
                           .Excludes(dataset)
                           .TypeName("ROBOT_POSES.yaml");
  command.AddOption("--sightings", options.sightings, "Points of the target that were seen before")
      .Excludes(dataset)
      .Needs(poses)
      .TypeName("SIGHTINGS.yaml");
  command
      .AddOption("--target", options.target,
                 "Description of the target (default: target.yaml of the data set)")
      .Needs(dataset)
      .TypeName("TARGET.yaml");
  command
      .AddOption("--cell", options.cell,
                 "Lens models: a cell.yaml, or a file with `camera` alone (default: cell.yaml of "
                 "the data set)")
      .TypeName("CELL.yaml");
}

void Declare(Command& command, HandEyeOptions& options) {
  DeclareInput(command, options);
  command
      .AddOption("--save-sightings", options.save_sightings,
                 "Write the points that were seen, to solve again without pictures")
      .TypeName("SIGHTINGS.yaml");
  command.AddOption("--out", options.out, "Result with covariance and verdict")
      .Required()
      .TypeName("HAND_EYE.yaml");
  command
      .AddOption("--edges", options.edges,
                 "Edges of the tf tree, as scanner_node reads them: the edge `scanner` is set, "
                 "others stay; a missing file is made")
      .TypeName("EDGES.yaml");
  command
      .AddOption("--flange-frame", options.flange_frame,
                 "Frame of the flange in the edges (eye in hand)")
      .TypeName("FRAME")
      .ShowDefault();
  command
      .AddOption("--base-frame", options.base_frame,
                 "Frame of the robot's base in the edges (eye to hand)")
      .TypeName("FRAME")
      .ShowDefault();
  command.AddFlag("--force", options.force,
                  "Write a result that the verdict rejects; else an earlier one stays");
}

/// What the calibration works on, in the order of the robot poses.
struct HandEyeInput {
  HandEyeMount mount = HandEyeMount::kEyeInHand;
  std::vector<DevicePose> robot_poses;
  std::vector<TargetSighting> sightings;
  TargetView view;
  std::vector<std::string> skipped;
};

/// Finds the target at one pose of the robot; a picture without it is an error.
class StationEye {
 public:
  static Result<StationEye> Open(const HandEyeOptions& options, const TargetView& view,
                                 Session& session) {
    StationEye eye(view, options.dataset);
    const auto stages = LoadSightingConfig(session);
    if (!stages) return Forward(stages);
    eye.config_ = *stages;
    return eye;
  }

  /// @return the outer error where a file cannot be read.
  Result<Result<TargetSighting>> See(const RobotStation& station) const {
    Result<TargetSighting> sighting = Fail("{}: names neither image nor view", station.pose.name);
    if (!station.image.empty()) {
      const auto pixels = ReadGrayImage(station.image);
      if (!pixels) return Forward(pixels);
      const Image<float> picture = GreyPicture(*pixels);
      const CameraModel& camera = view_.devices.camera;
      if (picture.width() != camera.width || picture.height() != camera.height) {
        return Fail("{}: is {} x {}, the camera of the calibration {} x {}", station.image,
                    picture.width(), picture.height(), camera.width, camera.height);
      }
      sighting = DetectTarget(picture, view_.target, config_.detect);
    } else if (station.view >= 0) {
      const auto scan = OpenUncalibratedScan(folder_);
      if (!scan) return Forward(scan);
      const auto stack = ReadStack(*scan, station.view);
      if (!stack) return Forward(stack);
      sighting = SightTarget(*stack, view_.target, config_, station.pose.name);
    } else {
      return Forward(sighting);
    }
    if (sighting) sighting->name = station.pose.name;
    return sighting;
  }

 private:
  StationEye(const TargetView& view, std::string folder)
      : view_(view), folder_(std::move(folder)) {}

  TargetView view_;
  std::string folder_;
  SightingConfig config_;
};

Result<HandEyeInput> LookAtStations(const HandEyeOptions& options, Session& session) {
  const fs::path folder = options.dataset;
  const auto file = LoadRobotPoses((folder / "robot_poses.yaml").string());
  if (!file) return Forward(file);
  const auto target =
      LoadTarget(options.target.empty() ? (folder / "target.yaml").string() : options.target);
  if (!target) return Forward(target);
  const auto devices =
      ReadRig(options.cell.empty() ? (folder / "cell.yaml").string() : options.cell);
  if (!devices) return Forward(devices);
  HandEyeInput input{file->mount, {}, {}, {*target, *devices}, {}};
  const auto eye = StationEye::Open(options, input.view, session);
  if (!eye) return Forward(eye);
  session.console.Begin("detect", static_cast<int>(file->stations.size()));
  for (std::size_t i = 0; i < file->stations.size(); ++i) {
    if (!session.console.Part(static_cast<int>(i))("detect", 0.0)) return Fail("{}", kCancelled);
    auto sighting = eye->See(file->stations[i]);
    if (!sighting) return Forward(sighting);
    if (*sighting) {
      input.robot_poses.push_back(file->stations[i].pose);
      input.sightings.push_back(std::move(**sighting));
    } else {
      input.skipped.push_back(
          fmt::format("{}: {}", file->stations[i].pose.name, sighting->error().message));
    }
  }
  session.console.End();
  return input;
}

Status CheckCommandLine(const HandEyeOptions& options) {
  if (options.dataset.empty() == options.poses.empty()) {
    return Fail("exactly one of --dataset and --poses is needed");
  }
  if (!options.poses.empty() && (options.sightings.empty() || options.cell.empty())) {
    return Fail("--poses needs --sightings and --cell");
  }
  return {};
}

Result<HandEyeInput> LoadInput(const HandEyeOptions& options, Session& session) {
  if (!options.dataset.empty()) return LookAtStations(options, session);
  const auto file = LoadRobotPoses(options.poses);
  if (!file) return Forward(file);
  const auto seen = LoadSightings(options.sightings);
  if (!seen) return Forward(seen);
  const auto devices = ReadRig(options.cell);
  if (!devices) return Forward(devices);
  HandEyeInput input{file->mount, {}, {}, {seen->target, *devices}, {}};
  std::vector<std::string> names;
  for (const RobotStation& station : file->stations) {
    input.robot_poses.push_back(station.pose);
    names.push_back(station.pose.name);
  }
  auto ordered = SightingsOf(names, seen->sightings, options.sightings);
  if (!ordered) return Forward(ordered);
  input.sightings = std::move(*ordered);
  return input;
}

void Print(const HandEyeResult& result, const std::vector<std::string>& skipped) {
  for (const std::string& reason : skipped) fmt::print("skipped: {}\n", reason);
  PrintOutcomes(result.poses);
  const bool in_hand = result.mount == HandEyeMount::kEyeInHand;
  fmt::print("T_{}_camera: {}\n", in_hand ? "flange" : "base",
             PoseWords(result.T_carrier_camera, result.covariance_camera));
  fmt::print("T_{}_target: {}\n", in_hand ? "base" : "flange",
             PoseWords(result.T_other_target, result.covariance_target));
  if (result.sigma_camera[0] > 0.0) {
    const CameraModel& m = result.camera;
    fmt::print("lens found along: fx {:.2f} fy {:.2f} cx {:.2f} cy {:.2f} k1 {:.4f} k2 {:.4f}\n",
               m.fx, m.fy, m.cx, m.cy, m.distortion[0], m.distortion[1]);
  }
  fmt::print("{}\n", result.verdict.words);
}

void SetFigures(const HandEyeResult& result, std::size_t num_skipped, Json& figures) {
  int num_used = 0;
  for (const DevicePoseOutcome& pose : result.poses) num_used += pose.used ? 1 : 0;
  figures.Set("accepted", result.verdict.accepted)
      .Set("verdict", result.verdict.words)
      .Set("mount", HandEyeMountName(result.mount))
      .Set("num_poses", result.poses.size() + num_skipped)
      .Set("num_poses_used", num_used)
      .Set("T_carrier_camera", PoseFigure(result.T_carrier_camera, result.covariance_camera))
      .Set("T_other_target", PoseFigure(result.T_other_target, result.covariance_target))
      .Set("max_rotation_deg", result.max_rotation_deg)
      .Set("max_cross_rotation_deg", result.max_cross_rotation_deg)
      .Set("condition", result.condition)
      .Set("sigma_scale_rotation", result.sigma_scale_rotation)
      .Set("sigma_scale_translation", result.sigma_scale_translation)
      .Set("sigma_scale_target", result.sigma_scale_target)
      .Set("rms_px", result.rms_px)
      .Set("target_spread_m", result.target_spread_m)
      .Set("predicted_error_m", result.predicted_error_m)
      .Set("poses", OutcomeFigures(result.poses));
}

Status Write(const HandEyeOptions& options, const HandEyeResult& result) {
  if (Status status = WriteHandEye(result, options.out); !status) return status;
  if (options.edges.empty()) return {};
  std::vector<FrameEdge> edges;
  if (fs::exists(options.edges)) {
    auto known = ReadFrameEdges(options.edges);
    if (!known) return Forward(known);
    edges = std::move(*known);
  }
  SetFrameEdge(ScannerEdge(result, options.flange_frame, options.base_frame), edges);
  return WriteFrameEdges(edges, options.edges);
}

Status HandEye(const HandEyeOptions& options, Session& session) {
  for (const std::string& file : {options.out, options.edges, options.save_sightings}) {
    if (file.empty()) continue;
    if (Status status = CheckOutputFile(file, {".yaml"}); !status) return status;
  }
  if (!options.dataset.empty()) session.AdoptSettings(options.dataset);
  const auto config = session.LoadStage<HandEyeConfig>("hand_eye");
  if (!config) return Forward(config);
  const auto input = LoadInput(options, session);
  if (!input) return Forward(input);
  if (!options.save_sightings.empty()) {
    const CellCalibration& devices = input->view.devices;
    const SightingsFile file{input->view.target,       devices.camera.width,
                             devices.camera.height,    devices.projector.width,
                             devices.projector.height, input->sightings};
    if (Status status = SaveSightings(file, options.save_sightings); !status) return status;
  }
  session.console.Begin("solve", 1);
  const auto result =
      CalibrateHandEye(input->robot_poses, input->sightings, input->view, input->mount, *config);
  if (!result) {
    return Fail("{}{}{}", result.error().message,
                input->skipped.empty() ? "" : "; skipped: ", fmt::join(input->skipped, "; "));
  }
  session.console.End();
  Print(*result, input->skipped);
  SetFigures(*result, input->skipped.size(), session.figures);
  if (!result->verdict.accepted && !options.force) return NotWritten(options.out, result->verdict);
  return Write(options, *result);
}

}  // namespace

void AddHandEye(Tool& tool) {
  AddCommand<HandEyeOptions>(
      tool, "hand-eye",
      "Robot poses and pictures of a target -> hand-eye with covariance and a verdict in words",
      Declare, HandEye, CheckCommandLine);
}

}  // namespace fringe_fusion::cli
