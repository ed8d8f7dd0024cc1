#include "fringe_fusion/calibration/turntable_axis.hpp"

#include <algorithm>
#include <cmath>

#include "chain_run.hpp"
#include "common/constants.hpp"
#include "common/median.hpp"
#include "hand_eye_verdict.hpp"

namespace fringe_fusion {
namespace {

using chain::ChainRun;

constexpr double kMinTurnRad = 3.0 * kRadPerDeg;    // less tells no axis
constexpr double kMaxTurnRad = 175.0 * kRadPerDeg;  // a half turn has no sign
// [rad^-2] of an angle that nothing else tells: it may be any, but their mean stays.
constexpr double kOpenAngleInformation = 1.0;

/// One turn from a stop to another, as the camera saw it.
struct SeenTurn {
  std::size_t from = 0;
  std::size_t to = 0;
  Transform T = Transform::Identity();  ///< camera frame
  Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero();
};

std::vector<SeenTurn> TurnsOf(const ChainRun& run) {
  std::vector<SeenTurn> turns;
  const std::vector<std::size_t> used = chain::UsedPoses(run);
  for (std::size_t i = 0; i < used.size(); ++i) {
    for (std::size_t j = i + 1; j < used.size(); ++j) {
      SeenTurn turn{used[i], used[j], Transform::Identity(), Eigen::Vector3d::Zero()};
      turn.T =
          run.measured.T_camera_target[turn.to] * run.measured.T_camera_target[turn.from].inverse();
      turn.rotation_rad = LogRotation(turn.T.linear());
      const double angle = turn.rotation_rad.norm();
      if (angle > kMinTurnRad && angle < kMaxTurnRad) turns.push_back(turn);
    }
  }
  return turns;
}

/// A line that the camera sees the target turn about.
struct SeenAxis {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  double median_tilt_rad = kInfinity;  ///< of single turns from the direction
};

/// Medians over the turns, so that a few bad stops do not matter.
SeenAxis FindAxis(const std::vector<SeenTurn>& turns, const Eigen::Vector3d& middle_camera) {
  SeenAxis axis;
  for (const SeenTurn& candidate : turns) {
    const Eigen::Vector3d direction = candidate.rotation_rad.normalized();
    std::vector<double> tilts;
    for (const SeenTurn& turn : turns) {
      const Eigen::Vector3d other = turn.rotation_rad.normalized();
      tilts.push_back(std::atan2(other.cross(direction).norm(), std::abs(other.dot(direction))));
    }
    const double tilt = Median(std::move(tilts));
    if (!(tilt < axis.median_tilt_rad)) continue;
    axis.median_tilt_rad = tilt;
    axis.direction = direction;
  }
  // The centre of each turn across its own axis; the point nearest to the middle of what was seen.
  std::array<std::vector<double>, 3> centres;
  const Eigen::Matrix3d across =
      Eigen::Matrix3d::Identity() - axis.direction * axis.direction.transpose();
  for (const SeenTurn& turn : turns) {
    // (I - R) c = moved for a turn by theta about n: c = (moved + cot(theta / 2) n x moved) / 2.
    const double angle = turn.rotation_rad.norm();
    const Eigen::Vector3d n = turn.rotation_rad / angle;
    Eigen::Vector3d moved = turn.T * middle_camera - middle_camera;
    moved -= n.dot(moved) * n;
    const Eigen::Vector3d offset = 0.5 * across * (moved + n.cross(moved) / std::tan(0.5 * angle));
    for (Eigen::Index i = 0; i < 3; ++i) {
      centres[static_cast<std::size_t>(i)].push_back(offset[i]);
    }
  }
  axis.point = middle_camera +
               across * Eigen::Vector3d(Median(centres[0]), Median(centres[1]), Median(centres[2]));
  return axis;
}

/// Angle of a rotation about an axis that it may not quite have: that of the swing-free part.
double TwistAngle(const Eigen::Matrix3d& R, const Eigen::Vector3d& direction) {
  const Eigen::Quaterniond q(R);
  return 2.0 * std::atan2(q.vec().dot(direction), q.w());
}

double Wrapped(double angle_rad) { return std::remainder(angle_rad, kTwoPi); }

/// Degrees from the first to the last stop, the largest gap left out.
double ArcDeg(const std::vector<double>& angles_rad) {
  std::vector<double> sorted;
  for (const double angle : angles_rad) {
    const double wrapped = Wrapped(angle);
    sorted.push_back(wrapped < 0.0 ? wrapped + kTwoPi : wrapped);
  }
  std::sort(sorted.begin(), sorted.end());
  double gap = sorted.front() + kTwoPi - sorted.back();
  for (std::size_t i = 1; i < sorted.size(); ++i) gap = std::max(gap, sorted[i] - sorted[i - 1]);
  return kDegPerRad * (kTwoPi - gap);
}

/// Angles of the stops: those stated, or those seen, with the direction so that they grow.
Result<std::vector<double>> AnglesOf(const std::vector<TurntableStop>& stops,
                                     const std::vector<SeenTurn>& turns, const ChainRun& run,
                                     const TurntableConfig& config, SeenAxis& axis) {
  double along = 0.0;
  for (const SeenTurn& turn : turns) {
    const double seen = turn.rotation_rad.dot(axis.direction);
    // Free angles grow from each stop to the next one.
    const double expected = config.angles_known
                                ? Wrapped(stops[turn.to].angle_rad - stops[turn.from].angle_rad)
                            : turn.to == turn.from + 1 ? 1.0
                                                       : 0.0;
    along += (expected > 0.0 ? 1.0 : expected < 0.0 ? -1.0 : 0.0) * seen;
  }
  if (along < 0.0) axis.direction = -axis.direction;
  std::vector<double> angles;
  const std::vector<std::size_t> used = chain::UsedPoses(run);
  const Eigen::Matrix3d first = run.measured.T_camera_target[used.front()].linear();
  const double zero = config.angles_known ? stops[used.front()].angle_rad : 0.0;
  for (std::size_t k = 0; k < stops.size(); ++k) {
    const Eigen::Matrix3d R = run.measured.T_camera_target[k].linear() * first.transpose();
    angles.push_back(config.angles_known ? stops[k].angle_rad
                                         : zero + TwistAngle(R, axis.direction));
  }
  if (!config.angles_known) return angles;
  std::vector<double> misses;
  for (const SeenTurn& turn : turns) {
    const double stated = angles[turn.to] - angles[turn.from];
    misses.push_back(std::abs(Wrapped(TwistAngle(turn.T.linear(), axis.direction) - stated)));
  }
  const double miss_deg = kDegPerRad * Median(std::move(misses));
  if (!(miss_deg <= config.max_angle_miss_deg)) {
    return Fail(
        "the stated angles contradict the target: turns differ by {:.2f} deg from what was seen "
        "(median), limit {} deg: are they in another unit, order or direction?",
        miss_deg, config.max_angle_miss_deg);
  }
  return angles;
}

/// z along the axis, x near the camera's x, or its z where that is the axis.
Transform BaseFrame(const SeenAxis& axis) {
  const Eigen::Vector3d hint =
      std::abs(axis.direction.x()) < 0.9 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d y = axis.direction.cross(hint).normalized();
  Transform T = Transform::Identity();
  T.linear() << y.cross(axis.direction), y, axis.direction;
  T.translation() = axis.point;
  return T;
}

Eigen::Vector3d MiddleSeen(const ChainRun& run) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const std::size_t k : chain::UsedPoses(run)) {
    middle += run.measured.T_camera_target[k] * run.measured.middle_target;
  }
  return middle / chain::NumUsed(run);
}

Result<ChainRun> StartTurntable(const std::vector<TurntableStop>& stops, chain::Measured measured,
                                const TurntableConfig& config) {
  ChainRun run;
  run.measured = std::move(measured);
  run.chain.in_hand = false;  // T_camera_base RotZ(angle) T_table_target
  run.chain.free[2] = run.chain.free[5] = false;
  run.limits.min_poses = config.min_poses;
  run.limits.max_pose_ratio = config.max_pose_ratio;
  run.limits.max_condition = config.max_condition;
  run.limits.groups = {0, 0, 0, 0, 0, 0};
  for (std::size_t k = 0; k < stops.size(); ++k) {
    chain::Link link;
    if (!run.measured.reasons[k].empty()) link.weight = 0.0;
    run.chain.links.push_back(link);
    run.names.push_back(stops[k].name);
  }
  if (Status status = chain::CheckNumUsed(run); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return run;
}

/// Prior of what a stop may be off: wobble and runout, and the angle where it is known.
void SetLinks(const std::vector<TurntableStop>& stops, const std::vector<double>& angles,
              const TurntableConfig& config, ChainRun& run) {
  for (std::size_t k = 0; k < stops.size(); ++k) {
    chain::Link& link = run.chain.links[k];
    link.T_base_flange = Transform(Eigen::AngleAxisd(angles[k], Eigen::Vector3d::UnitZ()));
    const double wobble = config.sigma_wobble_deg * kRadPerDeg;
    const double runout = 1e-3 * config.sigma_runout_mm;
    const double angle = stops[k].sigma_angle_rad > 0.0 ? stops[k].sigma_angle_rad
                                                        : config.sigma_angle_deg * kRadPerDeg;
    Vector6d information;
    information << Eigen::Vector3d::Constant(1.0 / (wobble * wobble)),
        Eigen::Vector3d::Constant(1.0 / (runout * runout));
    information[2] = config.angles_known ? 1.0 / (angle * angle) : kOpenAngleInformation;
    link.information = information.asDiagonal();
  }
}

/// The base's origin moves along the axis to the place that the result states.
void FillAxis(const ChainRun& run, TurntableResult& result) {
  const Transform& T_camera_base = run.state.T_camera_carrier;
  const double height = (T_camera_base.inverse() * MiddleSeen(run)).z();
  const Transform shift(Eigen::Translation3d(0.0, 0.0, height));
  result.T_camera_base = T_camera_base * shift;
  result.T_table_target = shift.inverse() * run.state.T_other_target;
  // B Exp(b) S = B S Exp(Adjoint(S^-1) b)
  const Matrix6d by_shift = Adjoint(shift.inverse());
  result.covariance_base =
      by_shift * run.covariance.ends.topLeftCorner<6, 6>() * by_shift.transpose();
  result.point_camera = result.T_camera_base.translation();
  result.direction_camera = result.T_camera_base.linear().col(2);
  const Matrix6d& covariance = result.covariance_base;
  result.sigma_direction_rad = std::sqrt(0.5 * (covariance(0, 0) + covariance(1, 1)));
  result.sigma_point_m = std::sqrt(0.5 * (covariance(3, 3) + covariance(4, 4)));
}

void FillStops(ChainRun& run, TurntableResult& result) {
  result.stops = chain::OutcomesOf(run);
  double sum_m2 = 0.0;
  std::vector<double> used_angles;
  for (std::size_t k = 0; k < result.stops.size(); ++k) {
    const Eigen::Matrix3d R =
        (run.chain.links[k].T_base_flange * run.state.corrections[k]).linear();
    const double stated =
        TwistAngle(run.chain.links[k].T_base_flange.linear(), Eigen::Vector3d::UnitZ());
    const double turned = TwistAngle(R, Eigen::Vector3d::UnitZ());
    result.angles_rad[k] += Wrapped(turned - stated);
    if (!result.stops[k].used) continue;
    used_angles.push_back(result.angles_rad[k]);
    // Off the circle, whatever the angle.
    const Transform T_base_target =
        result.T_camera_base.inverse() * result.stops[k].T_camera_target;
    const Eigen::Vector3d seen = T_base_target * run.measured.middle_target;
    const Eigen::Vector3d circle = result.T_table_target * run.measured.middle_target;
    const double radial = seen.head<2>().norm() - circle.head<2>().norm();
    sum_m2 += radial * radial + (seen.z() - circle.z()) * (seen.z() - circle.z());
  }
  result.rms_miss_m = std::sqrt(sum_m2 / static_cast<double>(used_angles.size()));
  result.arc_deg = ArcDeg(used_angles);
}

Status CheckArc(const std::vector<double>& angles, const ChainRun& run,
                const TurntableConfig& config) {
  std::vector<double> used;
  for (const std::size_t k : chain::UsedPoses(run)) used.push_back(angles[k]);
  const double arc_deg = ArcDeg(used);
  if (arc_deg >= config.min_arc_deg) return {};
  return Fail("the stops span {:.2f} deg, at least {} deg are needed: turn the table further{}",
              arc_deg, config.min_arc_deg, chain::ReasonsOf(run));
}

Result<TurntableResult> SolveTurntable(const std::vector<TurntableStop>& stops,
                                       chain::Measured measured, const TurntableConfig& config) {
  auto run = StartTurntable(stops, std::move(measured), config);
  if (!run) return Forward(run);
  const std::vector<SeenTurn> turns = TurnsOf(*run);
  if (turns.empty()) {
    return Fail("the target turns by less than {:.0f} deg between all stops: turn the table",
                kDegPerRad * kMinTurnRad);
  }
  SeenAxis axis = FindAxis(turns, MiddleSeen(*run));
  if (!(axis.median_tilt_rad <= config.max_tilt_deg * kRadPerDeg)) {
    return Fail(
        "the motion is no rotation about one axis: the axes of single turns lie {:.2f} deg from "
        "the best one (median), limit {} deg: did the target or the camera move?",
        kDegPerRad * axis.median_tilt_rad, config.max_tilt_deg);
  }
  const auto angles = AnglesOf(stops, turns, *run, config, axis);
  if (!angles) return Forward(angles);
  Status status = CheckArc(*angles, *run, config);
  if (!status) return tl::unexpected<Error>(status.error());
  SetLinks(stops, *angles, config, *run);
  status = chain::RunChain({BaseFrame(axis)}, *run);
  if (status) status = CheckArc(*angles, *run, config);
  if (!status) return tl::unexpected<Error>(status.error());
  if (!(run->covariance.condition <= config.max_condition)) {
    return Fail("the stops do not determine the axis: condition number {:.3g}, limit {:.3g}",
                run->covariance.condition, config.max_condition);
  }
  TurntableResult result;
  result.angles_rad = *angles;
  FillAxis(*run, result);
  FillStops(*run, result);
  result.condition = run->covariance.condition;
  result.sigma_scale_table = run->sigma_scale[0];
  result.sigma_scale_target = run->measured.sigma_scale;
  result.rms_px = chain::RmsOfPoints(result.stops);
  result.verdict = internal::JudgeTurntable(result, config);
  return result;
}

Status CheckStops(const std::vector<TurntableStop>& stops, std::size_t num_targets,
                  const TurntableConfig& config) {
  if (Status status = CheckBounds(config, "turntable"); !status) return status;
  if (stops.size() != num_targets) {
    return Fail("{} stops of the turntable for {} targets", stops.size(), num_targets);
  }
  for (const TurntableStop& stop : stops) {
    if (!(stop.sigma_angle_rad >= 0.0) || !std::isfinite(stop.sigma_angle_rad) ||
        (config.angles_known && !std::isfinite(stop.angle_rad))) {
      return Fail(
          "{}: angle {} rad with a sigma of {} rad: both must be finite, the latter not "
          "negative",
          stop.name, stop.angle_rad, stop.sigma_angle_rad);
    }
  }
  return {};
}

}  // namespace

Result<TurntableResult> CalibrateTurntable(const std::vector<TurntableStop>& stops,
                                           const std::vector<TargetPose>& target_poses,
                                           const TurntableConfig& config) {
  if (Status status = CheckStops(stops, target_poses.size(), config); !status) {
    return tl::unexpected<Error>(status.error());
  }
  std::vector<DevicePose> names(stops.size());
  for (std::size_t k = 0; k < stops.size(); ++k) names[k].name = stops[k].name;
  auto measured = chain::MeasureTargets(names, target_poses);
  if (!measured) return Forward(measured);
  return SolveTurntable(stops, std::move(*measured), config);
}

Result<TurntableResult> CalibrateTurntable(const std::vector<TurntableStop>& stops,
                                           const std::vector<TargetSighting>& sightings,
                                           const TargetView& view, const TurntableConfig& config) {
  if (Status status = CheckStops(stops, sightings.size(), config); !status) {
    return tl::unexpected<Error>(status.error());
  }
  auto measured = chain::MeasureTargets(sightings, view, {config.huber_sigma, config.reject_sigma});
  if (!measured) return Forward(measured);
  return SolveTurntable(stops, std::move(*measured), config);
}

std::vector<TargetPose> TargetPosesOfViews(const std::vector<Pose>& views) {
  std::vector<TargetPose> targets;
  for (const Pose& view : views) {
    // (T Exp(xi))^-1 = T^-1 Exp(-Adjoint(T) xi)
    const Matrix6d by_view = Adjoint(view.T_object_camera);
    const Matrix6d covariance = by_view * view.covariance * by_view.transpose();
    targets.push_back(
        {view.T_object_camera.inverse(), Matrix6d(0.5 * (covariance + covariance.transpose()))});
  }
  return targets;
}

}  // namespace fringe_fusion
