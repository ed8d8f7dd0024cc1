#include "pose_figures.hpp"

#include <cmath>

namespace fringe_fusion::cli {
namespace {

constexpr double kDegPerRad = 57.29577951308232;

/// Root mean square standard deviation of a block of the covariance [deg].
double SigmaDeg(const RelativePose& pose, Eigen::Index first, Eigen::Index count) {
  const double variance = pose.covariance.diagonal().segment(first, count).mean();
  return kDegPerRad * std::sqrt(variance);
}

}  // namespace

double RotationDeg(const RelativePose& pose, const CellCalibration& calibration) {
  return kDegPerRad * LogRotation(calibration.T_projector_camera.linear().transpose() *
                                  pose.T_observed_anchor.linear())
                          .norm();
}

double DirectionDeg(const RelativePose& pose, const CellCalibration& calibration) {
  const Eigen::Vector3d a = calibration.T_projector_camera.translation();
  const Eigen::Vector3d b = pose.T_observed_anchor.translation();
  return kDegPerRad * std::atan2(a.cross(b).norm(), a.dot(b));
}

Json PoseFigures(const RelativePose& pose, const CellCalibration& calibration) {
  const Eigen::Vector3d t = pose.T_observed_anchor.translation();
  const Eigen::Vector4d q = QuaternionXyzw(pose.T_observed_anchor);
  Json direction;
  direction.Set("x", t.x()).Set("y", t.y()).Set("z", t.z());
  Json quaternion;
  quaternion.Set("x", q.x()).Set("y", q.y()).Set("z", q.z()).Set("w", q.w());
  return Json()
      .Set("num_matches", pose.num_matches)
      .Set("num_inliers", pose.num_inliers)
      .Set("median_residual_px", pose.median_residual_px)
      .Set("rms_residual_px", pose.rms_residual_px)
      .Set("reduced_chi2", pose.reduced_chi2)
      .Set("condition", pose.condition)
      .Set("planar", pose.planar)
      .Set("sigma_rotation_deg", SigmaDeg(pose, 0, 3))
      .Set("sigma_direction_deg", SigmaDeg(pose, 3, 2))
      .Set("rotation_from_calibration_deg", RotationDeg(pose, calibration))
      .Set("direction_from_calibration_deg", DirectionDeg(pose, calibration))
      .Set("baseline_direction_projector", direction)
      .Set("quaternion_projector_camera", quaternion);
}

Json HealthFigures(int view_id, const HealthReport& report) {
  return Json()
      .Set("view", view_id)
      .Set("level", HealthLevelName(report.level))
      .Set("message", report.message)
      .Set("num_pixels", report.num_pixels)
      .Set("median_px", report.median_px)
      .Set("median_abs_px", report.median_abs_px)
      .Set("systematic_px", report.systematic_px)
      .Set("refit_systematic_px", report.refit_systematic_px)
      .Set("reduced_chi2", report.reduced_chi2)
      .Set("moved", MovedDeviceName(report.motion.moved))
      .Set("turn_deg", report.motion.turn_deg)
      .Set("direction_deg", report.motion.direction_deg)
      .Set("significance", report.motion.significance);
}

Json DriftFigures(const Drift& drift) {
  return Json()
      .Set("num_scans", drift.num_scans)
      .Set("span_h", drift.span_h)
      .Set("rate_px_h", drift.rate_px_h)
      .Set("sigma_px_h", drift.sigma_px_h)
      .Set("turn_rate_deg_h", drift.turn_rate_deg_h.norm())
      .Set("sigma_turn_deg_h", drift.sigma_turn_deg_h)
      .Set("significant", drift.significant)
      .Set("message", drift.message);
}

Report::Table PoseTable(const RelativePose& pose, const CellCalibration& calibration) {
  Report::Table table;
  table.title = "Pose from the codes against the calibration";
  table.header = {"matches",
                  "inliers",
                  "median [px]",
                  "rms [px]",
                  "chi2/dof",
                  "rotation [deg]",
                  "direction [deg]",
                  "sigma rotation [deg]",
                  "sigma direction [deg]"};
  table.rows.push_back(
      {std::to_string(pose.num_matches), std::to_string(pose.num_inliers),
       fmt::format("{:.3f}", pose.median_residual_px), fmt::format("{:.3f}", pose.rms_residual_px),
       fmt::format("{:.2f}", pose.reduced_chi2),
       fmt::format("{:.4f}", RotationDeg(pose, calibration)),
       fmt::format("{:.4f}", DirectionDeg(pose, calibration)),
       fmt::format("{:.4f}", SigmaDeg(pose, 0, 3)), fmt::format("{:.4f}", SigmaDeg(pose, 3, 2))});
  return table;
}

Report::Table HealthTable(const std::vector<int>& view_ids,
                          const std::vector<HealthReport>& reports) {
  Report::Table table;
  table.title = "Health of the calibration";
  table.header = {"view", "level", "median [px]", "median |.| [px]", "systematic [px]", "verdict"};
  for (std::size_t i = 0; i < reports.size(); ++i) {
    const HealthReport& report = reports[i];
    table.rows.push_back({std::to_string(view_ids[i]), HealthLevelName(report.level),
                          fmt::format("{:.3f}", report.median_px),
                          fmt::format("{:.3f}", report.median_abs_px),
                          fmt::format("{:.3f}", report.systematic_px), report.message});
  }
  return table;
}

}  // namespace fringe_fusion::cli
