// The whole calibration from rendered frames, held against a plate that took no part:
//   cell_proof [poses] [stations]
// Experiment E1: poses of a dot plate are rendered in the simulated cell, decoded, located and
// calibrated; then another plate is measured at stations over 80 mm of depth, and the errors of its
// dots after one rigid alignment over all stations are counted per axis.
#include <Eigen/Geometry>
#include <algorithm>
#include <stdexcept>

#include "fringe_fusion/calibration/error_field.hpp"
#include "fringe_fusion/calibration/sighting_from_scan.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"
#include "fringe_fusion/sim/target_plate.hpp"
#include "test/calibration/cell_scene.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

/// The cell of the scene with a camera of half the pixels: 1.25 million.
CellCalibration ProofCell() {
  CellCalibration cell = SceneCell();
  CameraModel& camera = cell.camera;
  camera.width /= 2;
  camera.height /= 2;
  camera.fx *= 0.5;
  camera.fy *= 0.5;
  camera.cx = 0.5 * (camera.cx + 0.5) - 0.5;
  camera.cy = 0.5 * (camera.cy + 0.5) - 0.5;
  return cell;
}

CalibrationTarget Plate(int columns, int rows, double pitch_m) {
  CalibrationTarget target;
  target.kind = TargetKind::kCircles;
  target.num_columns = columns;
  target.num_rows = rows;
  target.pitch_m = pitch_m;
  target.dot_radius_m = 0.2 * pitch_m;
  target.print_ratio = 0.1;
  const int middle = rows / 2 * columns + columns / 2;
  target.marked_points = {middle, middle + 1, middle + 2 * columns};
  target.marked_radius_m = 1.4 * target.dot_radius_m;
  return target;
}

sim::SimConfig NoisyCell(int seed) {
  sim::SimConfig config;
  config.seed = seed;
  config.camera_blur_px = 0.7;
  config.projector_blur_px = 0.8;
  config.gain_dn = 0.05;
  config.read_noise_dn = 1.0;
  config.ambient_ratio = 0.05;
  config.albedo = 0.9;
  return config;
}

/// Renders, decodes and locates one pose.
TargetSighting Sighted(const CalibrationTarget& target, const CellCalibration& cell,
                       const Transform& T_camera_target, int index) {
  const sim::SurfacePrint print{MakeTargetPrint(target), Transform::Identity(), 1e-4};
  auto sim = sim::SimCell::Create(NoisyCell(100 + index), cell, sim::MakeTargetPlate(print), Mesh{},
                                  print);
  if (!sim) throw std::runtime_error(sim.error().message);
  if (Status s = sim->MoveTo(T_camera_target.inverse(), 0); !s) {
    throw std::runtime_error(s.error().message);
  }
  PatternConfig patterns;
  patterns.fringes = "1,6,36";
  const auto sequence = MakeSequence(patterns, cell.projector.width, cell.projector.height);
  const auto stack = sim::CaptureStack(*sim, *sequence, 1.0, 0.02, index);
  if (!stack) throw std::runtime_error(stack.error().message);
  auto sighting = SightTarget(*stack, target, SightingConfig{}, "pose " + std::to_string(index));
  if (!sighting) {
    fmt::print("{}\n", sighting.error().message);
    return {};
  }
  return std::move(*sighting);
}

/// How far located dots lie from the truth, per axis, with the ratio to what was stated.
struct Localisation {
  double camera_px2 = 0.0;
  double projector_px2 = 0.0;
  double camera_ratio = 0.0;
  double projector_ratio = 0.0;
  double count_camera = 0.0;
  double count_projector = 0.0;
};

void Add(const CalibrationTarget& target, const CellCalibration& cell, const Transform& T,
         const TargetSighting& sighting, Localisation& sum) {
  const auto points = TargetPoints(target);
  for (const PointSighting& seen : sighting.points) {
    const Eigen::Vector3d& point = points[static_cast<std::size_t>(seen.point)];
    const Eigen::Vector2d camera =
        seen.pixel_camera - CentreOfImage(cell.camera, T, point, DotRadius(target, seen.point));
    sum.camera_px2 += camera.squaredNorm();
    sum.camera_ratio += camera.dot(seen.covariance_camera_px2.inverse() * camera);
    sum.count_camera += 2.0;
    if (!seen.has_projector) continue;
    const Eigen::Vector2d projector =
        seen.pixel_projector - Project(cell.projector, cell.T_projector_camera * (T * point));
    sum.projector_px2 += projector.squaredNorm();
    sum.projector_ratio += projector.dot(seen.covariance_projector_px2.inverse() * projector);
    sum.count_projector += 2.0;
  }
}

struct Measured {
  int station = 0;
  Eigen::Vector3d truth = Eigen::Vector3d::Zero();
  Eigen::Vector3d found = Eigen::Vector3d::Zero();        ///< from the frames
  Eigen::Vector3d calibration = Eigen::Vector3d::Zero();  ///< from exact pixels
  Eigen::Vector3d predicted_m2 = Eigen::Vector3d::Zero();
};

std::vector<Measured> MeasureStation(const CalibrationTarget& target, const CellCalibration& truth,
                                     const CellCalibrationResult& result, const Transform& T,
                                     int station) {
  const TargetSighting sighting = Sighted(target, truth, T, 1000 + station);
  const auto points = TargetPoints(target);
  const auto centres = TrueCentres(sighting, target);
  std::vector<Measured> all;
  for (std::size_t i = 0; i < centres.size(); ++i) {
    const PointSighting& seen = sighting.points[i];
    if (!seen.has_projector) continue;
    Measured measured;
    measured.station = station;
    measured.truth = T * points[static_cast<std::size_t>(seen.point)];
    const MeasurementNoise noise{std::sqrt(seen.covariance_camera_px2(0, 0)),
                                 std::sqrt(seen.covariance_projector_px2(0, 0))};
    const auto found =
        TriangulatePixels(result.calibration, centres[i], seen.pixel_projector, noise);
    const auto exact = TriangulatePixels(
        result.calibration, Project(truth.camera, measured.truth),
        Project(truth.projector, truth.T_projector_camera * measured.truth), noise);
    const auto error =
        PredictPointError(result.calibration, result.covariance, measured.truth, noise);
    if (!found || !exact || !error) continue;
    measured.found = *found;
    measured.calibration = *exact;
    measured.predicted_m2 = (error->calibration + error->random).diagonal();
    all.push_back(measured);
  }
  return all;
}

/// Rigid (or similarity) alignment of the measured to the true points.
Eigen::Matrix4d Alignment(const std::vector<Measured>& all, bool with_scale,
                          Eigen::Vector3d Measured::*which) {
  Eigen::Matrix3Xd from(3, all.size());
  Eigen::Matrix3Xd to(3, all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    from.col(static_cast<Eigen::Index>(i)) = all[i].*which;
    to.col(static_cast<Eigen::Index>(i)) = all[i].truth;
  }
  return Eigen::umeyama(from, to, with_scale);
}

void PrintAxes(const char* what, const std::vector<Measured>& all, const Eigen::Matrix4d& Q,
               Eigen::Vector3d Measured::*which) {
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  Eigen::Vector3d largest = Eigen::Vector3d::Zero();
  std::vector<double> norms;
  for (const Measured& m : all) {
    const Eigen::Vector3d e = (Q * (m.*which).homogeneous()).head<3>() - m.truth;
    squares += e.cwiseAbs2();
    largest = largest.cwiseMax(e.cwiseAbs());
    norms.push_back(e.norm());
  }
  std::sort(norms.begin(), norms.end());
  const Eigen::Vector3d s = 1e3 * (squares / (static_cast<double>(all.size()) - 2.0)).cwiseSqrt();
  fmt::print("{}: s {:.4f} {:.4f} {:.4f} mm, largest {:.4f} {:.4f} {:.4f} mm, 95 % {:.4f} mm\n",
             what, s.x(), s.y(), s.z(), 1e3 * largest.x(), 1e3 * largest.y(), 1e3 * largest.z(),
             1e3 * norms[norms.size() * 95 / 100]);
}

/// What is common to the dots of one station: shift along z and tilt.
void PrintStations(const std::vector<Measured>& all, const Eigen::Matrix4d& Q, int num_stations) {
  for (int station = 0; station < num_stations; ++station) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (const Measured& m : all) {
      if (m.station != station) continue;
      const Eigen::Vector3d e = (Q * m.found.homogeneous()).head<3>() - m.truth;
      const Eigen::Vector3d row(1.0, m.truth.x(), m.truth.y());
      normal += row * row.transpose();
      right += row * e.z();
    }
    const Eigen::Vector3d plane = normal.inverse() * right;
    fmt::print("  station {}: mean {:+.4f} mm, tilt {:+.4f} {:+.4f} mm over 300 mm\n", station,
               1e3 * plane[0], 300.0 * plane[1], 300.0 * plane[2]);
  }
}

void Prove(int num_poses, int num_stations) {
  const CellCalibration truth = ProofCell();
  const CalibrationTarget target = Plate(11, 9, 0.025);
  const std::vector<Transform> poses = ScenePoses(target, num_poses, 21);
  std::vector<TargetSighting> sightings;
  Localisation sum;
  for (int k = 0; k < num_poses; ++k) {
    const Transform& T = poses[static_cast<std::size_t>(k)];
    TargetSighting sighting = Sighted(target, truth, T, k);
    if (sighting.points.empty()) continue;
    Add(target, truth, T, sighting, sum);
    sightings.push_back(std::move(sighting));
  }
  fmt::print(
      "{} of {} poses, {:.0f} dots: camera {:.4f} px per axis (squared over stated {:.2f}), "
      "projector "
      "{:.4f} px ({:.2f})\n",
      sightings.size(), num_poses, 0.5 * sum.count_camera,
      std::sqrt(sum.camera_px2 / sum.count_camera), sum.camera_ratio / sum.count_camera,
      std::sqrt(sum.projector_px2 / sum.count_projector),
      sum.projector_ratio / sum.count_projector);
  const auto result = CalibrateCell(target, sightings, SizesOf(truth), {});
  if (!result) throw std::runtime_error(result.error().message);
  int dof = 0;
  const double normalised = NormalizedError(*result, truth, &dof);
  fmt::print(
      "{}\nlens {} / {}, scale of sigma {:.2f} / {:.2f}, squared error over stated {:.2f} ({} "
      "parameters)\n",
      result->verdict.words, DistortionName(result->distortion_camera),
      DistortionName(result->distortion_projector), result->sigma_scale_camera,
      result->sigma_scale_projector, normalised, dof);
  const CalibrationTarget held_out = Plate(13, 13, 0.0225);
  std::vector<Measured> all;
  for (int station = 0; station < num_stations; ++station) {
    const double z = 0.66 + 0.08 * station / std::max(1, num_stations - 1);
    const Transform T = ScenePose(held_out, Eigen::Vector3d(0.0, 0.0, z), 0.0, 0.0, 0.0);
    const auto measured = MeasureStation(held_out, truth, *result, T, station);
    all.insert(all.end(), measured.begin(), measured.end());
  }
  fmt::print("held-out plate, {} dots at {} stations over 80 mm\n", all.size(), num_stations);
  PrintAxes("not aligned", all, Eigen::Matrix4d::Identity(), &Measured::found);
  const Eigen::Matrix4d Q = Alignment(all, false, &Measured::found);
  PrintAxes("one rigid alignment", all, Q, &Measured::found);
  PrintAxes("calibration part, aligned", all, Alignment(all, false, &Measured::calibration),
            &Measured::calibration);
  const Eigen::Matrix4d similarity = Alignment(all, true, &Measured::found);
  fmt::print("scale error {:.1f} ppm\n",
             1e6 * (std::cbrt(similarity.topLeftCorner<3, 3>().determinant()) - 1.0));
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  Eigen::Vector3d predicted = Eigen::Vector3d::Zero();
  for (const Measured& m : all) {
    squares += (m.found - m.truth).cwiseAbs2();
    predicted += m.predicted_m2;
  }
  const Eigen::Vector3d ratio = squares.cwiseQuotient(predicted).cwiseSqrt();
  fmt::print("measured over predicted, not aligned: {:.2f} {:.2f} {:.2f}, all axes {:.2f}\n",
             ratio.x(), ratio.y(), ratio.z(), std::sqrt(squares.sum() / predicted.sum()));
  PrintStations(all, Q, num_stations);
}

}  // namespace
}  // namespace fringe_fusion

int main(int argc, char** argv) {
  try {
    fringe_fusion::Prove(argc > 1 ? std::stoi(argv[1]) : 30, argc > 2 ? std::stoi(argv[2]) : 7);
  } catch (const std::exception& error) {
    fmt::print(stderr, "cell_proof: {}\n", error.what());
    return 1;
  }
  return 0;
}
