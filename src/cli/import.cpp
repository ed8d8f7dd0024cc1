// fringe import: a recorded bag -> a scan folder, or one of its clouds -> PLY; a calibration of
// another program -> cell.yaml.
#include <cmath>
#include <optional>

#include "command.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/io/opencv_calibration.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/ros_io/bag_reader.hpp"
#include "staged_folder.hpp"
#include "views.hpp"

namespace fringe_fusion::cli {
namespace {

using ros_io::BagReader;
using ros_io::BagStack;

struct ImportOptions {
  std::string bag;
  std::string calibration;
  std::string camera_size;
  std::string projector_size;
  std::string out;
  std::string cloud;
  std::string scan_id;
  std::string frames_topic;
  std::string camera_info_topic;
  std::string projector_info_topic;
  std::string object_frame = "object";
  double prior_sigma_mm = 0.2;
  double prior_sigma_deg = 0.1;
  bool list = false;
};

void Declare(Command& command, ImportOptions& options) {
  command.AddOption("--bag", options.bag, "Recorded bag").TypeName("FILE");
  command
      .AddOption("--calibration", options.calibration,
                 "Instead of a bag: a calibration of sltk, slstudio or procam-calibration (OpenCV "
                 "YAML or XML, mm); --out is the cell.yaml to write")
      .TypeName("FILE");
  command
      .AddOption("--camera-size", options.camera_size,
                 "Size of the camera, where the calibration does not state it")
      .TypeName("WxH");
  command
      .AddOption("--projector-size", options.projector_size,
                 "Size of the projector, where the calibration does not state it")
      .TypeName("WxH");
  command
      .AddOption("--out", options.out,
                 "Scan folder to write; with --cloud: the cloud, .ply or .pcd")
      .TypeName("SCAN/|CLOUD.ply");
  command
      .AddOption("--cloud", options.cloud,
                 "Write the first sensor_msgs/PointCloud2 of this topic instead of a scan")
      .TypeName("TOPIC");
  command.AddFlag("--list", options.list, "Print the topics of the bag and stop");
  command
      .AddOption("--scan-id", options.scan_id,
                 "Which scan to import; needed when the bag has several")
      .TypeName("ID");
  command
      .AddOption("--frames", options.frames_topic,
                 "Topic of the frames (default: the only one that ends in frames)")
      .TypeName("TOPIC");
  command
      .AddOption("--camera-info", options.camera_info_topic,
                 "Topic (default: the only one that ends in camera_info)")
      .TypeName("TOPIC");
  command
      .AddOption("--projector-info", options.projector_info_topic,
                 "Topic (default: the only one that ends in projector_info)")
      .TypeName("TOPIC");
  command
      .AddOption("--object-frame", options.object_frame,
                 "tf frame of the part; without it in tf the views get no prior pose")
      .TypeName("FRAME")
      .ShowDefault();
  command
      .AddOption("--prior-sigma-mm", options.prior_sigma_mm,
                 "Standard deviation of the positions in tf [mm]")
      .InRange(0.0, 1e6)
      .TypeName("MM")
      .ShowDefault();
  command
      .AddOption("--prior-sigma-deg", options.prior_sigma_deg,
                 "Standard deviation of the rotations in tf [deg]")
      .InRange(0.0, 180.0)
      .TypeName("DEG")
      .ShowDefault();
}

/// Pose of the camera when the first frame of a stack was taken.
Result<std::optional<Pose>> PriorFromTf(const ImportOptions& options, BagReader& bag,
                                        const BagStack& recorded) {
  if (!bag.HasFrame(options.object_frame)) return std::optional<Pose>();
  const auto T_object_camera = bag.LookupTransform(options.object_frame, recorded.camera_frame,
                                                   recorded.stack.frames.front().stamp_ns);
  if (!T_object_camera) {
    return Fail("view {}: {}", recorded.stack.view_id, T_object_camera.error().message);
  }
  Pose pose;
  pose.T_object_camera = *T_object_camera;
  pose.covariance = PoseCovariance(options.prior_sigma_deg * std::acos(-1.0) / 180.0,
                                   options.prior_sigma_mm * 1e-3);
  pose.source = PoseSource::kTf;
  return std::optional<Pose>(pose);
}

Status ImportScan(const ImportOptions& options, BagReader& bag, Session& session) {
  const auto calibration =
      bag.ReadCalibration(options.camera_info_topic, options.projector_info_topic);
  if (!calibration) return tl::unexpected(calibration.error());
  auto folder = StagedFolder::Create(options.out);
  if (!folder) return tl::unexpected(folder.error());
  std::optional<ScanFolder> scan;
  std::string scan_id;
  int num_views = 0;
  int num_priors = 0;
  const auto take = [&](BagStack recorded) -> Status {
    if (!scan) {
      auto created = CreateScan(folder->path(), *calibration, recorded.stack.sequence);
      if (!created) return tl::unexpected(created.error());
      scan = std::move(*created);
      scan_id = recorded.stack.scan_id;
    }
    const auto prior = PriorFromTf(options, bag, recorded);
    if (!prior) return tl::unexpected(prior.error());
    ++num_views;
    num_priors += prior->has_value() ? 1 : 0;
    return WriteStack(*scan, recorded.stack, *prior, {});
  };
  session.console.Begin("import", 1);
  if (Status status =
          bag.ReadStacks(options.frames_topic, options.scan_id, take, session.console.Part(0));
      !status) {
    return status;
  }
  if (num_views == 0) return Fail("{}: has no complete view", options.bag);
  session.console.End();
  session.figures.Set("scan_id", scan_id)
      .Set("calibration_id", CalibrationId(*calibration))
      .Set("num_views", num_views)
      .Set("num_views_with_prior", num_priors);
  fmt::print("{}: {} views, {} with a prior pose\n", options.out, num_views, num_priors);
  return folder->Commit();
}

Status ImportCloud(const ImportOptions& options, BagReader& bag, Session& session) {
  if (Status status = CheckOutputFile(options.out, {".ply", ".pcd"}); !status) return status;
  const auto cloud = bag.ReadCloud(options.cloud);
  if (!cloud) return tl::unexpected(cloud.error());
  session.figures.Set("num_points", cloud->vertices.size());
  fmt::print("{}: {} points\n", options.out, cloud->vertices.size());
  return WriteMesh(*cloud, options.out);
}

/// Nothing given: nothing known.
Result<PictureSize> SizeOption(const std::string& option, const std::string& text) {
  return text.empty() ? PictureSize() : ParsePictureSize(option, text);
}

Status CheckCommandLine(const ImportOptions& options) {
  if (options.bag.empty() == options.calibration.empty()) {
    return Fail("exactly one of --bag and --calibration is needed");
  }
  if (options.out.empty() && !options.list)
    return Fail("--out: is required unless --list is given");
  const auto camera = SizeOption("--camera-size", options.camera_size);
  if (!camera) return Forward(camera);
  const auto projector = SizeOption("--projector-size", options.projector_size);
  return projector ? Status() : Forward(projector);
}

Status ImportCalibration(const ImportOptions& options, Session& session) {
  if (Status status = CheckOutputFile(options.out, {".yaml"}); !status) return status;
  const auto camera_size = SizeOption("--camera-size", options.camera_size);
  if (!camera_size) return tl::unexpected(camera_size.error());
  const auto projector_size = SizeOption("--projector-size", options.projector_size);
  if (!projector_size) return tl::unexpected(projector_size.error());
  const auto calibration =
      ReadOpenCvCalibration(options.calibration, *camera_size, *projector_size);
  if (!calibration) return tl::unexpected(calibration.error());
  session.figures.Set("calibration_id", CalibrationId(*calibration))
      .Set("rms_px", calibration->rms_px);
  fmt::print("{}: camera {} x {}, projector {} x {}, baseline {:.4f} m\n", options.out,
             calibration->camera.width, calibration->camera.height, calibration->projector.width,
             calibration->projector.height, calibration->T_projector_camera.translation().norm());
  return WriteCellCalibration(*calibration, options.out);
}

Status Import(const ImportOptions& options, Session& session) {
  if (!options.calibration.empty()) return ImportCalibration(options, session);
  auto bag = BagReader::Open(options.bag);
  if (!bag) return tl::unexpected(bag.error());
  if (options.list) {
    for (const std::string& topic : bag->Topics()) fmt::print("{}\n", topic);
    return {};
  }
  return options.cloud.empty() ? ImportScan(options, *bag, session)
                               : ImportCloud(options, *bag, session);
}

}  // namespace

void AddImport(Tool& tool) {
  AddCommand<ImportOptions>(
      tool, "import",
      "A recorded bag -> a scan folder, or a cloud of it; a calibration -> cell.yaml", Declare,
      Import, CheckCommandLine);
}

}  // namespace fringe_fusion::cli
