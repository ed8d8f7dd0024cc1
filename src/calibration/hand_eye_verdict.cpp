#include "hand_eye_verdict.hpp"

#include <algorithm>
#include <cmath>

#include "common/constants.hpp"

namespace fringe_fusion::internal {
namespace {

/// Collects the limits that were passed.
class Limits {
 public:
  void AtMost(const std::string& what, double value, double most, const std::string& unit) {
    if (value <= most) return;  // NaN is a reason
    verdict.reasons.push_back(
        fmt::format("{} {:.4g} {} is above {:.4g} {}", what, value, unit, most, unit));
  }
  Verdict verdict;
};

int NumUsedOf(const std::vector<DevicePoseOutcome>& poses) {
  return static_cast<int>(
      std::count_if(poses.begin(), poses.end(), [](const DevicePoseOutcome& p) { return p.used; }));
}

double RejectedRatio(const std::vector<DevicePoseOutcome>& poses) {
  return 1.0 - static_cast<double>(NumUsedOf(poses)) / static_cast<double>(poses.size());
}

std::string AdviceOnHandEye(const HandEyeResult& result, const HandEyeConfig& config) {
  if (RejectedRatio(result.poses) > config.max_rejected_ratio) {
    return "look at the reasons of the poses that were left out before taking more";
  }
  if (std::max(result.sigma_scale_rotation, result.sigma_scale_translation) > 2.0) {
    return fmt::format(
        "the poses scatter {:.1f} times in rotation and {:.1f} times in translation as much as is "
        "stated for the robot: its accuracy, the lens model, the size of the target or the moment "
        "of exposure is worse",
        result.sigma_scale_rotation, result.sigma_scale_translation);
  }
  if (result.max_cross_rotation_deg < 30.0) {
    return fmt::format(
        "turn the flange about a second axis: across the main one it turns by {:.1f} deg only",
        result.max_cross_rotation_deg);
  }
  if (result.max_rotation_deg < 60.0) {
    return fmt::format("turn the flange more than {:.1f} deg: 60 and above tell most",
                       result.max_rotation_deg);
  }
  return fmt::format("more poses: twice as many lower the predicted error to {:.4f} mm",
                     1e3 * result.predicted_error_m / std::sqrt(2.0));
}

std::string AdviceOnTurntable(const TurntableResult& result, const TurntableConfig& config) {
  if (RejectedRatio(result.stops) > config.max_rejected_ratio) {
    return "look at the reasons of the stops that were left out before taking more";
  }
  if (result.sigma_scale_table > 2.0) {
    return fmt::format(
        "the stops scatter {:.1f} times as much as is stated for the table: play of the bearing, a "
        "target that moves on it, or the lens model",
        result.sigma_scale_table);
  }
  if (result.arc_deg < 180.0) {
    return fmt::format("spread the stops: they span {:.1f} deg only", result.arc_deg);
  }
  return fmt::format("more stops: twice as many lower the deviations to {:.4f} deg and {:.4f} mm",
                     kDegPerRad * result.sigma_direction_rad / std::sqrt(2.0),
                     1e3 * result.sigma_point_m / std::sqrt(2.0));
}

std::string JoinedReasons(const Verdict& verdict) {
  return fmt::format("{}{}", verdict.reasons.empty() ? "" : "; ", fmt::join(verdict.reasons, "; "));
}

}  // namespace

Verdict JudgeHandEye(const HandEyeResult& result, const HandEyeConfig& config) {
  Limits limits;
  limits.AtMost("predicted error of a point at the target", 1e3 * result.predicted_error_m,
                1e3 * config.max_error_m, "mm");
  limits.AtMost("rotation of the robot against its stated sigma", result.sigma_scale_rotation,
                config.max_sigma_scale, "times");
  limits.AtMost("translation of the robot against its stated sigma", result.sigma_scale_translation,
                config.max_sigma_scale, "times");
  limits.AtMost("share of poses that do not fit", 100.0 * RejectedRatio(result.poses),
                100.0 * config.max_rejected_ratio, "%");
  Verdict& verdict = limits.verdict;
  verdict.accepted = verdict.reasons.empty();
  verdict.advice = AdviceOnHandEye(result, config);
  verdict.words = fmt::format(
      "{}: {} of {} poses, rotations up to {:.1f} deg, {:.1f} deg across the main axis; the target "
      "spreads by {:.3f} mm; predicted error of a point at the target {:.4f} mm (rms per axis){}. "
      "To improve first: {}.",
      verdict.accepted ? "accepted" : "rejected", NumUsedOf(result.poses), result.poses.size(),
      result.max_rotation_deg, result.max_cross_rotation_deg, 1e3 * result.target_spread_m,
      1e3 * result.predicted_error_m, JoinedReasons(verdict), verdict.advice);
  return verdict;
}

Verdict JudgeTurntable(const TurntableResult& result, const TurntableConfig& config) {
  Limits limits;
  limits.AtMost("standard deviation of the direction", kDegPerRad * result.sigma_direction_rad,
                config.max_sigma_direction_deg, "deg");
  limits.AtMost("standard deviation of the place", 1e3 * result.sigma_point_m,
                1e3 * config.max_sigma_point_m, "mm");
  limits.AtMost("stops of the table against their stated sigma", result.sigma_scale_table,
                config.max_sigma_scale, "times");
  limits.AtMost("share of stops that do not fit", 100.0 * RejectedRatio(result.stops),
                100.0 * config.max_rejected_ratio, "%");
  Verdict& verdict = limits.verdict;
  verdict.accepted = verdict.reasons.empty();
  verdict.advice = AdviceOnTurntable(result, config);
  verdict.words = fmt::format(
      "{}: {} of {} stops over {:.1f} deg; axis +- {:.4f} deg, +- {:.4f} mm; the target lies "
      "{:.4f} mm off its circle (rms){}. To improve first: {}.",
      verdict.accepted ? "accepted" : "rejected", NumUsedOf(result.stops), result.stops.size(),
      result.arc_deg, kDegPerRad * result.sigma_direction_rad, 1e3 * result.sigma_point_m,
      1e3 * result.rms_miss_m, JoinedReasons(verdict), verdict.advice);
  return verdict;
}

}  // namespace fringe_fusion::internal
