#include <Eigen/Geometry>
#include <cmath>
#include <numeric>

#include "common/constants.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"
#include "fringe_fusion/sim/simulate_scan.hpp"

namespace fringe_fusion::sim {
namespace {

// Optical frame at `eye` whose z axis points to `target` and whose y axis points away from `up`.
Transform LookAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target,
                 const Eigen::Vector3d& up) {
  Transform T = Transform::Identity();
  const Eigen::Vector3d forward = (target - eye).normalized();
  const Eigen::Vector3d right = forward.cross(up).normalized();
  T.linear() << right, forward.cross(right), forward;
  T.translation() = eye;
  return T;
}

struct CaptureSettings {
  PatternCorrection correction;
  double exposure_s = 0.0;
  int view_id = 0;
};

Result<ImageStack> Capture(SimCell& cell, const PatternSequence& sequence,
                           const std::vector<int>& shown, const CaptureSettings& settings) {
  if (const Status status = Validate(sequence, "simulated capture"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  ImageStack stack;
  stack.view_id = settings.view_id;
  stack.camera_id = cell.calibration().camera_serial;
  stack.sequence = sequence;
  Pattern black;
  black.kind = PatternKind::kBlack;
  for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
    const Pattern& pattern =
        shown[i] < 0 ? black : sequence.frames[static_cast<std::size_t>(shown[i])];
    const Image<std::uint8_t> picture =
        RenderCorrectedPattern(pattern, sequence.width, sequence.height, settings.correction);
    const double exposure_s = settings.exposure_s * sequence.frames[i].exposure_ratio;
    Result<CapturedFrame> frame = cell.Expose(picture, exposure_s, static_cast<int>(i));
    if (!frame) return Forward(frame);
    stack.frames.push_back(std::move(*frame));
  }
  return stack;
}

}  // namespace

CellCalibration DefaultCalibration() {
  CellCalibration calibration;
  CameraModel& camera = calibration.camera;
  camera.width = 800;
  camera.height = 600;
  camera.fx = 2102.0;
  camera.fy = 2100.0;
  camera.cx = 403.5;
  camera.cy = 297.0;
  camera.distortion = {-0.11, 0.14, 4e-4, -3e-4, 0.0};
  CameraModel& projector = calibration.projector;
  projector.width = 1280;
  projector.height = 800;
  projector.fx = 2650.0;
  projector.fy = 2648.0;
  projector.cx = 634.0;
  projector.cy = 690.0;  // lens shift, as in most projectors: the picture lies above the axis
  projector.distortion = {-0.05, 0.03, -2e-4, 3e-4, 0.0};

  // The ray of the projector's middle pixel meets the camera's axis at the working distance.
  const Eigen::Vector3d target_camera(0.0, 0.0, 0.5);
  const Eigen::Vector3d eye_camera(0.2, 0.015, 0.02);
  const Transform T_camera_axis = LookAt(eye_camera, target_camera, {0.0, -1.0, 0.0});
  const Eigen::Vector2d middle = Undistort(
      projector, Eigen::Vector2d(0.5 * (projector.width - 1), 0.5 * (projector.height - 1)));
  Transform T_camera_projector = T_camera_axis;
  T_camera_projector.linear() =
      T_camera_axis.linear() * RotationBetween(middle.homogeneous(), Eigen::Vector3d::UnitZ());
  calibration.T_projector_camera = T_camera_projector.inverse();
  calibration.camera_serial = "sim-camera";
  calibration.projector_serial = "sim-projector";
  return calibration;
}

Transform TurntablePose(int k, int n, double distance_m, double elevation_deg,
                        const Eigen::Vector3d& target_object) {
  const double elevation = elevation_deg * kPi / 180.0;
  const Eigen::Vector3d away(std::cos(elevation), 0.0, std::sin(elevation));
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  if (elevation_deg > 89.0) up = -Eigen::Vector3d::UnitX();
  const Transform T_cell_camera = LookAt(target_object + distance_m * away, target_object, up);
  // The object has turned by +angle, so that its frame sees the camera turned by -angle.
  Transform T_object_cell = Transform::Identity();
  T_object_cell.linear() = ExpRotation(Eigen::Vector3d(0.0, 0.0, -2.0 * kPi * k / n));
  return T_object_cell * T_cell_camera;
}

Matrix6d PoseErrorCovariance(const SimConfig& config, const Transform& T_object_camera) {
  const double angle = config.turntable_angle_sigma_deg * kPi / 180.0;
  const double shift = 1e-3 * config.turntable_shift_sigma_mm;
  Vector6d turntable;
  turntable << 0.0, 0.0, angle * angle, shift * shift, shift * shift, 0.0;
  // Exp(xi) T = T Exp(Adjoint(T^-1) xi).
  const Matrix6d to_camera = Adjoint(T_object_camera.inverse());
  Matrix6d covariance = to_camera * turntable.asDiagonal() * to_camera.transpose();
  covariance += PoseCovariance(config.arm_rotation_sigma_deg * kPi / 180.0,
                               1e-3 * config.arm_translation_sigma_mm);
  return 0.5 * (covariance + covariance.transpose());
}

Result<ImageStack> CaptureStack(SimCell& cell, const PatternSequence& sequence,
                                double gamma_correction, double exposure_s, int view_id) {
  return CaptureStack(cell, sequence, PatternCorrection{gamma_correction, {}}, exposure_s, view_id);
}

Result<ImageStack> CaptureStack(SimCell& cell, const PatternSequence& sequence,
                                const PatternCorrection& correction, double exposure_s,
                                int view_id) {
  std::vector<int> shown(sequence.frames.size());
  std::iota(shown.begin(), shown.end(), 0);
  return Capture(cell, sequence, shown, {correction, exposure_s, view_id});
}

Result<ImageStack> CaptureMisordered(SimCell& cell, const PatternSequence& sequence,
                                     const std::vector<int>& shown, double exposure_s,
                                     int view_id) {
  const auto last = static_cast<int>(sequence.frames.size()) - 1;
  for (const int pattern : shown) {
    if (pattern < -1 || pattern > last) {
      return Fail("simulated capture: shown pattern {} is outside [-1, {}]", pattern, last);
    }
  }
  if (shown.size() != sequence.frames.size()) {
    return Fail("simulated capture: {} shown patterns for {} frames", shown.size(),
                sequence.frames.size());
  }
  return Capture(cell, sequence, shown, {PatternCorrection{}, exposure_s, view_id});
}

}  // namespace fringe_fusion::sim
