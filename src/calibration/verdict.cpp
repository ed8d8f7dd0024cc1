#include <algorithm>
#include <cmath>
#include <limits>

#include "cell_run.hpp"
#include "coverage_grid.hpp"
#include "fringe_fusion/calibration/error_field.hpp"

namespace fringe_fusion::bundle {
namespace {

constexpr double kRadDeg = 180.0 / 3.14159265358979323846;

CoverageGrid FilledCells(const CellRun& run, std::size_t device) {
  const CameraModel& model = run.state.devices[device];
  CoverageGrid grid(model.width, model.height);
  for (const Station& station : run.problem.stations()) {
    for (const Observation& seen : station.seen[device]) grid.Add(seen.pixel);
  }
  return grid;
}

void Join(std::string& text, const std::string& more) {
  if (more.empty()) return;
  if (!text.empty()) text += "; ";
  text += more;
}

double FocalSigma(const CellCalibrationResult& result, int device) {
  const CameraModel& model = device == 0 ? result.calibration.camera : result.calibration.projector;
  const int at = device * kNumModel;
  return std::max(std::sqrt(result.covariance(at, at)) / model.fx,
                  std::sqrt(result.covariance(at + 1, at + 1)) / model.fy);
}

/// What to improve first, from the largest shortfall.
std::string Advice(const CellRun& run, const CellCalibrationResult& result) {
  const CalibrationConfig& config = run.config;
  const std::size_t num_out = result.poses.size() - static_cast<std::size_t>(NumPoses(run));
  if (3 * num_out > result.poses.size()) {
    return fmt::format("{} of {} poses were left out: look at their reasons before taking more",
                       num_out, result.poses.size());
  }
  for (const bool projector : {false, true}) {
    const double rms = projector ? result.rms_projector_px : result.rms_camera_px;
    const char* name = projector ? "projector" : "camera";
    if (rms > config.max_rms_px) {
      return fmt::format(
          "the {} points miss by {:.2f} px: check that the target is flat and still, "
          "the focus, and that its size is the right one",
          name, rms);
    }
  }
  if (result.coverage.depth_ratio < config.min_depth_ratio ||
      result.coverage.camera_ratio < config.min_coverage_ratio ||
      result.coverage.projector_ratio < config.min_coverage_ratio ||
      result.coverage.max_tilt_deg < 3.0 * config.min_tilt_deg) {
    return fmt::format("{}: {}", result.coverage.gaps, result.next.words);
  }
  for (const bool projector : {false, true}) {
    const double scale = projector ? result.sigma_scale_projector : result.sigma_scale_camera;
    if (!config.equal_weights && scale > 2.0) {
      return fmt::format(
          "the residuals in the {} are {:.1f} times the noise that was stated for "
          "the points: the lens model, the target or the detection is worse than "
          "its noise",
          projector ? "projector" : "camera", scale);
    }
  }
  return result.next.words;
}

}  // namespace

double MaxTiltDeg(const CellRun& run) {
  std::vector<Eigen::Vector3d> normals;
  for (const Station& station : run.problem.stations()) {
    if (station.seen[kCamera].empty()) continue;
    normals.emplace_back(run.state.blocks[station.block].T_camera_target.linear().col(2));
  }
  double lowest = 1.0;
  for (std::size_t i = 0; i < normals.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) lowest = std::min(lowest, normals[i].dot(normals[j]));
  }
  return kRadDeg * std::acos(std::max(-1.0, lowest));
}

Coverage AssessCoverage(const CellRun& run) {
  Coverage coverage;
  const CoverageGrid camera = FilledCells(run, kCamera);
  const CoverageGrid projector = FilledCells(run, kProjector);
  coverage.camera_ratio = camera.Ratio();
  coverage.projector_ratio = projector.Ratio();
  coverage.max_tilt_deg = MaxTiltDeg(run);
  double low = std::numeric_limits<double>::infinity();
  double high = 0.0;
  double sum = 0.0;
  double count = 0.0;
  for (const Station& station : run.problem.stations()) {
    for (const Observation& seen : station.seen[kCamera]) {
      const double z = (run.state.blocks[station.block].T_camera_target *
                        run.state.points_target[static_cast<std::size_t>(seen.point)])
                           .z();
      low = std::min(low, z);
      high = std::max(high, z);
      sum += z;
      count += 1.0;
    }
  }
  coverage.depth_ratio = count > 0.0 ? (high - low) / (sum / count) : 0.0;
  if (coverage.camera_ratio < run.config.min_coverage_ratio) {
    Join(coverage.gaps, camera.EmptyQuarters("camera"));
  }
  if (coverage.projector_ratio < run.config.min_coverage_ratio) {
    Join(coverage.gaps, projector.EmptyQuarters("projector"));
  }
  if (coverage.max_tilt_deg < 3.0 * run.config.min_tilt_deg) {
    Join(coverage.gaps,
         fmt::format("the poses differ by {:.1f} deg only: tilt the target to 30 deg",
                     coverage.max_tilt_deg));
  }
  if (coverage.depth_ratio < run.config.min_depth_ratio) {
    Join(
        coverage.gaps,
        fmt::format("the points cover only {:.1f} % of their distance in depth (at least {:.0f} %)",
                    100.0 * coverage.depth_ratio, 100.0 * run.config.min_depth_ratio));
  }
  return coverage;
}

Verdict Judge(const CellRun& run, const CellCalibrationResult& result, double error_before_m) {
  const CalibrationConfig& config = run.config;
  Verdict verdict;
  const auto limit = [&](const std::string& what, double value, double most,
                         const std::string& unit) {
    if (value <= most) return;
    verdict.reasons.push_back(
        fmt::format("{} {:.4g} {} is above {:.4g} {}", what, value, unit, most, unit));
  };
  limit("rms of the camera", result.rms_camera_px, config.max_rms_px, "px");
  limit("rms of the projector", result.rms_projector_px, config.max_rms_px, "px");
  limit("standard deviation of the camera's focal length", 100.0 * FocalSigma(result, 0),
        100.0 * config.max_focal_sigma_ratio, "%");
  limit("standard deviation of the projector's focal length", 100.0 * FocalSigma(result, 1),
        100.0 * config.max_focal_sigma_ratio, "%");
  limit("predicted error of a point", 1e3 * error_before_m, 1e3 * config.max_error_m, "mm");
  const int num_poses = NumPoses(run);
  if (2 * num_poses < static_cast<int>(result.poses.size())) {
    verdict.reasons.push_back(
        fmt::format("only {} of {} poses fit together", num_poses, result.poses.size()));
  }
  verdict.accepted = verdict.reasons.empty();
  verdict.advice = Advice(run, result);
  verdict.words = fmt::format(
      "{}: {} of {} poses, rms {:.3f} px in the camera, {:.3f} px in the projector, {:.3f} px "
      "together; predicted error of a point from the calibration {:.4f} mm (rms per axis){}{}. "
      "To improve first: {}.",
      verdict.accepted ? "accepted" : "rejected", num_poses, result.poses.size(),
      result.rms_camera_px, result.rms_projector_px, result.rms_joint_px, 1e3 * error_before_m,
      verdict.reasons.empty() ? "" : "; ", fmt::join(verdict.reasons, "; "), verdict.advice);
  return verdict;
}

}  // namespace fringe_fusion::bundle
