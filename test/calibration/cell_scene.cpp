#include "cell_scene.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "src/common/dense.hpp"

namespace fringe_fusion::test_support {

CellCalibration SceneCell() {
  CellCalibration cell;
  cell.camera = {2448, 2048, 4405.0, 4400.0, 1231.0, 1015.0, {-0.09, 0.12, 3e-4, -2e-4, 0.0}};
  cell.projector = {1280, 800, 1702.0, 1700.0, 635.0, 610.0, {-0.04, 0.03, -2e-4, 2e-4, 0.0}};
  // The projector's middle pixel looks at the middle of the volume.
  const Eigen::Vector3d eye(0.3, 0.01, 0.02);
  const Eigen::Vector3d forward = (Eigen::Vector3d(0.0, 0.0, 0.7) - eye).normalized();
  const Eigen::Vector2d middle =
      Undistort(cell.projector, Eigen::Vector2d(0.5 * 1279.0, 0.5 * 799.0));
  const Eigen::Vector3d right = Eigen::Vector3d::UnitY().cross(forward).normalized();
  Transform T_camera_axis = Transform::Identity();
  T_camera_axis.linear() << right, forward.cross(right), forward;
  T_camera_axis.translation() = eye;
  const Eigen::Matrix3d shift = RotationBetween(middle.homogeneous(), Eigen::Vector3d::UnitZ());
  cell.T_projector_camera = (T_camera_axis * Transform(shift)).inverse();
  return cell;
}

DeviceSizes SizesOf(const CellCalibration& cell) {
  return {cell.camera.width, cell.camera.height, cell.projector.width, cell.projector.height};
}

CalibrationTarget SceneTarget() {
  CalibrationTarget target;
  target.kind = TargetKind::kCircles;
  target.num_columns = 11;
  target.num_rows = 9;
  target.pitch_m = 0.025;
  target.dot_radius_m = 0.005;
  return target;
}

Transform ScenePose(const CalibrationTarget& target, const Eigen::Vector3d& middle, double tilt_rad,
                    double axis_rad, double roll_rad) {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  const std::vector<Eigen::Vector3d> points = TargetPoints(target);
  for (const Eigen::Vector3d& p : points) centre += p / static_cast<double>(points.size());
  Transform T = Transform::Identity();
  const Eigen::Vector3d axis(std::cos(axis_rad), std::sin(axis_rad), 0.0);
  T.linear() =
      (Eigen::AngleAxisd(tilt_rad, axis) * Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitZ()))
          .toRotationMatrix();
  T.translation() = middle - T.linear() * centre;
  return T;
}

std::vector<Transform> ScenePoses(const CalibrationTarget& target, int num, unsigned seed,
                                  double max_tilt_deg) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::vector<Transform> poses;
  for (int k = 0; k < num; ++k) {
    const Eigen::Vector3d middle(0.05 * uniform(random), 0.05 * uniform(random),
                                 0.7 + 0.04 * uniform(random));
    const double tilt = (0.5 + 0.5 * std::abs(uniform(random))) * max_tilt_deg * kRadPerDeg;
    const double axis = 2.0 * 3.14159265358979 * k / std::max(1, num) + 0.3 * uniform(random);
    const double roll = (k % 3 == 0 ? 90.0 : 20.0 * uniform(random)) * kRadPerDeg;
    poses.push_back(ScenePose(target, middle, tilt, axis, roll));
  }
  return poses;
}

bool InImage(const CameraModel& model, const Eigen::Vector2d& pixel) {
  return pixel.x() > 0.0 && pixel.y() > 0.0 && pixel.x() < model.width - 1 &&
         pixel.y() < model.height - 1;
}

Eigen::Vector2d CentreOfImage(const CameraModel& model, const Transform& T_camera_target,
                              const Eigen::Vector3d& centre, double radius_m) {
  constexpr int kRim = 360;
  std::vector<Eigen::Vector2d> rim;
  for (int i = 0; i < kRim; ++i) {
    const double angle = 2.0 * 3.14159265358979323846 * i / kRim;
    rim.push_back(Project(
        model, T_camera_target *
                   (centre + radius_m * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0))));
  }
  double area = 0.0;
  Eigen::Vector2d moment = Eigen::Vector2d::Zero();
  const Eigen::Vector2d origin = rim.front();
  for (int i = 0; i < kRim; ++i) {
    const Eigen::Vector2d a = rim[static_cast<std::size_t>(i)] - origin;
    const Eigen::Vector2d b = rim[static_cast<std::size_t>((i + 1) % kRim)] - origin;
    const double cross = a.x() * b.y() - a.y() * b.x();
    area += cross;
    moment += cross * (a + b) / 3.0;
  }
  return origin + moment / area;
}

TargetSighting Sight(const CellCalibration& cell, const CalibrationTarget& target,
                     const std::vector<Eigen::Vector3d>& points, const Transform& T,
                     const SceneNoise& noise, const std::string& name) {
  TargetSighting sighting;
  sighting.name = name;
  sighting.is_ellipse_centre = target.dot_radius_m > 0.0;
  std::mt19937 random(noise.seed);
  std::normal_distribution<double> normal;
  for (std::size_t j = 0; j < points.size(); ++j) {
    PointSighting seen;
    seen.point = static_cast<int>(j);
    const Eigen::Vector3d point_camera = T * points[j];
    seen.pixel_camera = target.dot_radius_m > 0.0
                            ? CentreOfImage(cell.camera, T, points[j], target.dot_radius_m)
                            : Project(cell.camera, point_camera);
    seen.pixel_projector = Project(cell.projector, cell.T_projector_camera * point_camera);
    // Points differ in their noise, as real ones do.
    const double factor = 0.7 + 0.7 * static_cast<double>((j * 7919) % 101) / 100.0;
    const double sigma_camera = factor * noise.sigma_camera_px;
    const double sigma_projector = factor * noise.sigma_projector_px;
    seen.covariance_camera_px2 = sigma_camera * sigma_camera * Eigen::Matrix2d::Identity();
    seen.covariance_projector_px2 = sigma_projector * sigma_projector * Eigen::Matrix2d::Identity();
    Eigen::Vector4d drawn(normal(random), normal(random), normal(random), normal(random));
    if (noise.off) drawn.setZero();
    seen.pixel_camera += sigma_camera * drawn.head<2>();
    seen.pixel_projector += sigma_projector * drawn.tail<2>();
    if (!InImage(cell.camera, seen.pixel_camera)) continue;
    seen.has_projector = InImage(cell.projector, seen.pixel_projector);
    sighting.points.push_back(seen);
  }
  return sighting;
}

std::vector<TargetSighting> SightAll(const CellCalibration& cell, const CalibrationTarget& target,
                                     const std::vector<Transform>& poses, const SceneNoise& noise) {
  std::vector<TargetSighting> sightings;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    SceneNoise own = noise;
    own.seed = noise.seed * 1000U + static_cast<unsigned>(k);
    sightings.push_back(
        Sight(cell, target, TargetPoints(target), poses[k], own, "pose " + std::to_string(k)));
  }
  return sightings;
}

Eigen::VectorXd ParameterError(const CellCalibration& found, const CellCalibration& truth) {
  Eigen::VectorXd error(kNumCellParameters);
  const auto fill = [&](Eigen::Index at, const CameraModel& a, const CameraModel& b) {
    error.segment<4>(at) << a.fx - b.fx, a.fy - b.fy, a.cx - b.cx, a.cy - b.cy;
    for (std::size_t k = 0; k < 5; ++k) {
      error[at + 4 + static_cast<Eigen::Index>(k)] = a.distortion[k] - b.distortion[k];
    }
  };
  fill(0, found.camera, truth.camera);
  fill(9, found.projector, truth.projector);
  // found = truth Exp(xi)
  error.tail<6>() = Log(truth.T_projector_camera.inverse() * found.T_projector_camera);
  return error;
}

double NormalizedError(const CellCalibrationResult& result, const CellCalibration& truth,
                       int* dof) {
  const Eigen::VectorXd error = ParameterError(result.calibration, truth);
  std::vector<Eigen::Index> free;
  for (Eigen::Index i = 0; i < kNumCellParameters; ++i) {
    if (result.covariance(i, i) > 0.0) free.push_back(i);
  }
  Eigen::MatrixXd covariance = result.covariance(free, free);
  Eigen::VectorXd part = error(free);
  const Eigen::VectorXd scale = covariance.diagonal().cwiseSqrt().cwiseInverse();
  covariance = scale.asDiagonal() * covariance * scale.asDiagonal();
  part = scale.cwiseProduct(part);
  *dof = static_cast<int>(free.size());
  return part.dot(Eigen::VectorXd(dense::SolveSymmetric(covariance, part))) / *dof;
}

}  // namespace fringe_fusion::test_support
