#include "fringe_fusion/sim/simulate_scan.hpp"

#include <algorithm>
#include <stdexcept>

#include "common/constants.hpp"
#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/image_io.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/io/poses_conf.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/sim/gauges.hpp"

namespace fringe_fusion::sim {
namespace {

// What all views add up to.
struct ScanTruth {
  std::vector<ConfEntry> poses;
  std::vector<std::uint8_t> face_visible;
};

Pose PriorPose(const SimulateScanConfig& config, const Transform& commanded) {
  Pose prior;
  prior.T_object_camera = commanded;
  prior.covariance = PoseErrorCovariance(config.sim, commanded) +
                     PoseCovariance(config.prior_rotation_sigma_deg * kPi / 180.0,
                                    1e-3 * config.prior_translation_sigma_mm);
  prior.source = PoseSource::kFile;
  return prior;
}

Status WriteTruthMaps(const ViewTruth& truth, const std::string& folder) {
  if (Status status = MakeFolder(folder); !status) return status;
  if (Status status = WriteImage(truth.u, folder + "/u.tiff"); !status) return status;
  if (Status status = WriteImage(truth.v, folder + "/v.tiff"); !status) return status;
  Image<std::uint8_t> lit = truth.lit;
  std::transform(lit.begin(), lit.end(), lit.begin(),
                 [](std::uint8_t value) { return value != 0 ? std::uint8_t{255} : value; });
  return WriteImage(lit, folder + "/lit.png");
}

Status WriteTruth(const ScanTruth& truth, const Mesh& object, const std::string& folder) {
  if (Status status = MakeFolder(folder); !status) return status;
  if (Status status = WritePosesConf(truth.poses, folder + "/poses.conf"); !status) return status;
  if (Status status = WriteMesh(object, folder + "/object.ply"); !status) return status;
  return WriteMesh(SelectFaces(object, truth.face_visible), folder + "/visible.ply");
}

// Moves to one stop, captures and writes the view, and adds to the truth.
Status ScanView(const SimulateScanConfig& config, const ScanFolder& scan, int view_id,
                SimCell& cell, ScanTruth& sum) {
  const Transform commanded =
      TurntablePose(view_id, config.views, config.distance_m, config.elevation_deg,
                    Eigen::Vector3d(0.0, 0.0, config.target_height_m));
  if (Status status = cell.MoveTo(commanded, view_id); !status) return status;
  const Result<ImageStack> stack =
      CaptureStack(cell, scan.sequence, PatternCorrection{config.pattern.gamma, config.response},
                   config.exposure_s, view_id);
  if (!stack) return Forward(stack);
  const double angle_rad = 2.0 * kPi * view_id / config.views;
  if (Status status = WriteStack(scan, *stack, PriorPose(config, commanded), {angle_rad});
      !status) {
    return status;
  }
  const ViewTruth truth = cell.Truth();
  sum.poses.push_back({fmt::format("../views/{:03d}/range.ply", view_id), truth.T_object_camera});
  for (std::size_t i = 0; i < truth.face_visible.size(); ++i) {
    if (truth.face_visible[i] != 0) sum.face_visible[i] = 1;
  }
  if (!config.write_truth_maps) return {};
  return WriteTruthMaps(truth, fmt::format("{}/truth/views/{:03d}", scan.path, view_id));
}

}  // namespace

Status SimulateScan(const SimulateScanConfig& config, const Mesh& object, const std::string& folder,
                    const Progress& progress) {
  if (Status status = CheckBounds(config, "simulate_scan"); !status) return status;
  const CameraModel& projector = config.calibration.projector;
  const Result<PatternSequence> sequence =
      MakeSequence(config.pattern, projector.width, projector.height);
  if (!sequence) return Forward(sequence);
  const Mesh plate = config.plate_radius_m > 0.0 ? MakePlate(config.plate_radius_m, 0.005) : Mesh{};
  Result<SimCell> cell = SimCell::Create(config.sim, config.calibration, object, plate);
  if (!cell) return Forward(cell);
  const Result<ScanFolder> scan = CreateScan(folder, config.calibration, *sequence);
  if (!scan) return Forward(scan);

  ScanTruth truth;
  truth.face_visible.assign(object.faces.size(), 0);
  for (int view_id = 0; view_id < config.views; ++view_id) {
    if (!progress("simulate", static_cast<double>(view_id) / config.views)) {
      return Fail("{}", kCancelled);
    }
    if (Status status = ScanView(config, *scan, view_id, *cell, truth); !status) return status;
  }
  if (!progress("simulate", 1.0)) return Fail("{}", kCancelled);
  return WriteTruth(truth, object, scan->path + "/truth");
}

Mesh SelectFaces(const Mesh& mesh, const std::vector<std::uint8_t>& face_visible) {
  if (face_visible.size() != mesh.faces.size()) {
    throw std::invalid_argument("SelectFaces: one mark per face is needed");
  }
  Mesh selected;
  std::vector<int> index(mesh.vertices.size(), -1);
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    if (face_visible[i] == 0) continue;
    Eigen::Vector3i face = mesh.faces[i];
    for (int corner = 0; corner < 3; ++corner) {
      const auto old = static_cast<std::size_t>(face[corner]);
      if (index[old] < 0) {
        index[old] = static_cast<int>(selected.vertices.size());
        selected.vertices.push_back(mesh.vertices[old]);
        if (!mesh.normals.empty()) selected.normals.push_back(mesh.normals[old]);
      }
      face[corner] = index[old];
    }
    selected.faces.push_back(face);
  }
  return selected;
}

}  // namespace fringe_fusion::sim
