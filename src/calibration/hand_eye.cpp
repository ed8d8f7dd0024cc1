#include "fringe_fusion/calibration/hand_eye.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "chain_run.hpp"
#include "common/constants.hpp"
#include "common/dense.hpp"
#include "fringe_fusion/pose/view.hpp"
#include "hand_eye_start.hpp"
#include "hand_eye_verdict.hpp"

namespace fringe_fusion {
namespace {

using chain::ChainRun;

constexpr std::array<const char*, 2> kMountNames = {"eye_in_hand", "eye_to_hand"};
constexpr double kLensRatioSigma = 0.1;       // of a focal length and of the image's size
constexpr double kLensDistortionSigma = 1.0;  // of k1 and k2
constexpr int kLensPasses = 6;
constexpr std::size_t kNumSubsets = 40;  // of three poses: most are good where a third is bad

Status CheckRobotPoses(const std::vector<DevicePose>& poses, std::size_t num_targets) {
  if (poses.size() != num_targets) {
    return Fail("{} robot poses for {} targets", poses.size(), num_targets);
  }
  for (const DevicePose& pose : poses) {
    if (!pose.T_base_flange.matrix().allFinite() || !pose.covariance.allFinite()) {
      return Fail("{}: the robot pose has a number that is not finite", pose.name);
    }
  }
  return {};
}

Result<chain::Link> RobotLink(const DevicePose& pose, const HandEyeConfig& config) {
  chain::Link link;
  link.T_base_flange = pose.T_base_flange;
  const Matrix6d covariance = pose.covariance.isZero(0.0)
                                  ? PoseCovariance(config.sigma_rotation_deg * kRadPerDeg,
                                                   1e-3 * config.sigma_translation_mm)
                                  : pose.covariance;
  const auto information = dense::SolvePositive(covariance, Matrix6d::Identity());
  if (!information || !information->allFinite()) {
    return Fail("{}: the covariance of the robot pose is not positive definite", pose.name);
  }
  link.information = 0.5 * (*information + information->transpose());
  return link;
}

/// How far the poses that take part turn the flange.
struct RobotMotion {
  double max_rotation_deg = 0.0;
  double max_cross_rotation_deg = 0.0;  ///< across the main axis
};

RobotMotion MotionOf(const ChainRun& run) {
  const std::vector<std::size_t> used = chain::UsedPoses(run);
  std::vector<Eigen::Vector3d> turns;
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < used.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const Eigen::Matrix3d R_i = run.chain.links[used[i]].T_base_flange.linear();
      const Eigen::Matrix3d R_j = run.chain.links[used[j]].T_base_flange.linear();
      // Of the flange in its base or in itself: the same angles about turned axes.
      turns.push_back(LogRotation(run.chain.in_hand ? Eigen::Matrix3d(R_i.transpose() * R_j)
                                                    : Eigen::Matrix3d(R_i * R_j.transpose())));
      moments += turns.back() * turns.back().transpose();
    }
  }
  RobotMotion motion;
  if (turns.empty()) return motion;
  const Eigen::Vector3d main_axis = dense::DecomposeSymmetric(moments).vectors.col(2);
  for (const Eigen::Vector3d& turn : turns) {
    motion.max_rotation_deg = std::max(motion.max_rotation_deg, kDegPerRad * turn.norm());
    motion.max_cross_rotation_deg =
        std::max(motion.max_cross_rotation_deg, kDegPerRad * turn.cross(main_axis).norm());
  }
  return motion;
}

Status CheckMotion(const RobotMotion& motion, const ChainRun& run, const HandEyeConfig& config) {
  if (!(motion.max_rotation_deg >= config.min_rotation_deg)) {
    return Fail(
        "the flange turns by at most {:.2f} deg between the poses, at least {} deg are needed: "
        "turn it more{}",
        motion.max_rotation_deg, config.min_rotation_deg, chain::ReasonsOf(run));
  }
  if (!(motion.max_cross_rotation_deg >= config.min_cross_rotation_deg)) {
    return Fail(
        "all rotations have nearly parallel axes: across the main one the flange turns by at most "
        "{:.2f} deg, at least {} deg are needed: along that axis the hand-eye stays open; turn "
        "the flange about a second axis{}",
        motion.max_cross_rotation_deg, config.min_cross_rotation_deg, chain::ReasonsOf(run));
  }
  return {};
}

/// Closed forms of all poses.
struct ClosedForms {
  std::optional<Transform> park_martin;
  std::optional<Transform> dual_quaternion;
};

ClosedForms SolveClosedForms(const ChainRun& run, const std::vector<std::size_t>& poses) {
  std::vector<Transform> targets;
  std::vector<Transform> carriers;
  for (const std::size_t k : poses) {
    targets.push_back(run.measured.T_camera_target[k]);
    carriers.push_back(chain::LinkMotion(run.chain, k, Transform::Identity()));
  }
  const auto motions = chain::MotionPairs(targets, carriers);
  return {chain::ParkMartin(motions), chain::DualQuaternion(motions)};
}

/// Those of all poses first, then of subsets, for sets of which some poses are bad.
std::vector<Transform> HandEyeStarts(const ChainRun& run, const ClosedForms& of_all) {
  std::vector<Transform> starts;
  if (of_all.park_martin) starts.push_back(*of_all.park_martin);
  if (of_all.dual_quaternion) starts.push_back(*of_all.dual_quaternion);
  const std::vector<std::size_t> used = chain::UsedPoses(run);
  std::size_t state = 1;  // a fixed sequence: the same poses give the same result
  const auto draw = [&] {
    state = (state * 1103515245U + 12345U) & 0x7fffffffU;
    return (state >> 8U) % used.size();
  };
  for (std::size_t i = 0; i < kNumSubsets; ++i) {
    const std::array<std::size_t, 3> drawn = {draw(), draw(), draw()};
    if (drawn[0] == drawn[1] || drawn[0] == drawn[2] || drawn[1] == drawn[2]) continue;
    const ClosedForms forms =
        SolveClosedForms(run, {used[drawn[0]], used[drawn[1]], used[drawn[2]]});
    if (forms.park_martin) starts.push_back(*forms.park_martin);
  }
  return starts;
}

/// Focal lengths and principal point, then k1, then k2; held by what a lens may differ at most.
void FreeLens(const HandEyeConfig& config, ChainRun& run) {
  if (config.refine_lens == 0) return;
  const CameraModel& lens = run.measured.points->state.devices[bundle::kCamera];
  const auto num_free = static_cast<std::size_t>(3 + config.refine_lens);
  for (std::size_t k = 0; k < num_free; ++k) run.chain.free[12 + k] = true;
  chain::LensVector sigma = chain::LensVector::Constant(kLensDistortionSigma);
  sigma.head<4>() << kLensRatioSigma * lens.fx, kLensRatioSigma * lens.fy,
      kLensRatioSigma * lens.width, kLensRatioSigma * lens.height;
  run.chain.lens_information = sigma.cwiseAbs2().cwiseInverse().asDiagonal();
}

void FillLens(const ChainRun& run, HandEyeResult& result) {
  if (!run.measured.points) return;
  result.camera = run.measured.points->state.devices[bundle::kCamera];
  for (Eigen::Index k = 0; k < chain::kNumLens; ++k) {
    result.sigma_camera[static_cast<std::size_t>(k)] =
        std::sqrt(std::max(0.0, run.covariance.ends(12 + k, 12 + k)));
  }
}

void FillTransforms(const ChainRun& run, HandEyeResult& result) {
  const Matrix6d by_camera = Adjoint(run.state.T_camera_carrier);
  result.T_carrier_camera = run.state.T_camera_carrier.inverse();
  result.T_other_target = run.state.T_other_target;
  // (T Exp(b))^-1 = T^-1 Exp(-Adjoint(T) b)
  const Matrix6d camera =
      by_camera * run.covariance.ends.topLeftCorner<6, 6>() * by_camera.transpose();
  result.covariance_camera = 0.5 * (camera + camera.transpose());
  result.covariance_target = run.covariance.ends.block<6, 6>(6, 6);
}

/// Spread of the target in the frame where it rests, and what the hand-eye alone does to a point.
void FillAccuracy(const ChainRun& run, HandEyeResult& result) {
  const Eigen::Vector3d& middle = run.measured.middle_target;
  const Eigen::Vector3d rest = result.T_other_target * middle;
  double sum_m2 = 0.0;
  Eigen::Vector3d mean_camera = Eigen::Vector3d::Zero();
  const double num_used = chain::NumUsed(run);
  for (const std::size_t k : chain::UsedPoses(run)) {
    const Transform G = chain::LinkMotion(run.chain, k, Transform::Identity());
    const Eigen::Vector3d point_camera = run.measured.T_camera_target[k] * middle;
    sum_m2 += (G.inverse() * (result.T_carrier_camera * point_camera) - rest).squaredNorm();
    mean_camera += point_camera / num_used;
  }
  result.target_spread_m = std::sqrt(sum_m2 / num_used);
  result.predicted_error_m =
      std::sqrt(chain::CovarianceOfPoint(result.covariance_camera, mean_camera).trace() / 3.0);
}

Result<HandEyeResult> SolveHandEye(const std::vector<DevicePose>& robot_poses,
                                   chain::Measured measured, HandEyeMount mount,
                                   const HandEyeConfig& config) {
  ChainRun run;
  run.measured = std::move(measured);
  run.chain.in_hand = mount == HandEyeMount::kEyeInHand;
  run.limits.min_poses = config.min_poses;
  run.limits.max_pose_ratio = config.max_pose_ratio;
  run.limits.max_condition = config.max_condition;
  if (run.measured.points) FreeLens(config, run);
  for (std::size_t k = 0; k < robot_poses.size(); ++k) {
    auto link = RobotLink(robot_poses[k], config);
    if (!link) return Forward(link);
    if (!run.measured.reasons[k].empty()) link->weight = 0.0;
    run.chain.links.push_back(*link);
    run.names.push_back(robot_poses[k].name);
  }
  Status status = chain::CheckNumUsed(run);
  if (status) status = CheckMotion(MotionOf(run), run, config);
  if (!status) return tl::unexpected<Error>(status.error());
  const ClosedForms forms = SolveClosedForms(run, chain::UsedPoses(run));
  status = chain::RunChain(HandEyeStarts(run, forms), run);
  const RobotMotion motion = MotionOf(run);
  if (status) status = CheckMotion(motion, run, config);
  if (!status) return tl::unexpected<Error>(status.error());
  if (!(run.covariance.condition <= config.max_condition)) {
    return Fail(
        "the poses do not determine the hand-eye: condition number {:.3g}, limit {:.3g}; turn the "
        "flange more, about several axes",
        run.covariance.condition, config.max_condition);
  }
  HandEyeResult result;
  result.mount = mount;
  FillTransforms(run, result);
  FillAccuracy(run, result);
  FillLens(run, result);
  result.poses = chain::OutcomesOf(run);
  const Transform none = result.T_carrier_camera;
  result.T_carrier_camera_park_martin = forms.park_martin ? forms.park_martin->inverse() : none;
  result.T_carrier_camera_dual_quaternion =
      forms.dual_quaternion ? forms.dual_quaternion->inverse() : none;
  result.max_rotation_deg = motion.max_rotation_deg;
  result.max_cross_rotation_deg = motion.max_cross_rotation_deg;
  result.condition = run.covariance.condition;
  result.sigma_scale_rotation = run.sigma_scale[0];
  result.sigma_scale_translation = run.sigma_scale[1];
  result.sigma_scale_target = run.measured.sigma_scale;
  result.rms_px = chain::RmsOfPoints(result.poses);
  result.verdict = internal::JudgeHandEye(result, config);
  return result;
}

}  // namespace

const char* HandEyeMountName(HandEyeMount mount) {
  return kMountNames[static_cast<std::size_t>(mount)];
}

Result<HandEyeMount> HandEyeMountFromName(const std::string& name) {
  for (std::size_t i = 0; i < kMountNames.size(); ++i) {
    if (name == kMountNames[i]) return static_cast<HandEyeMount>(i);
  }
  return Fail("mount '{}' must be {}", name, fmt::join(kMountNames, " or "));
}

Result<HandEyeResult> CalibrateHandEye(const std::vector<DevicePose>& robot_poses,
                                       const std::vector<TargetPose>& target_poses,
                                       HandEyeMount mount, const HandEyeConfig& config) {
  Status status = CheckBounds(config, "hand_eye");
  if (status) status = CheckRobotPoses(robot_poses, target_poses.size());
  if (!status) return tl::unexpected<Error>(status.error());
  auto measured = chain::MeasureTargets(robot_poses, target_poses);
  if (!measured) return Forward(measured);
  return SolveHandEye(robot_poses, std::move(*measured), mount, config);
}

Result<HandEyeResult> CalibrateHandEye(const std::vector<DevicePose>& robot_poses,
                                       const std::vector<TargetSighting>& sightings,
                                       const TargetView& view, HandEyeMount mount,
                                       const HandEyeConfig& config) {
  Status status = CheckBounds(config, "hand_eye");
  if (status) status = CheckRobotPoses(robot_poses, sightings.size());
  if (!status) return tl::unexpected<Error>(status.error());
  TargetView seen_through = view;
  // A lens that is found changes what every picture alone says: points and poses are judged anew.
  const int num_passes = config.refine_lens > 0 ? kLensPasses : 1;
  for (int pass = 1;; ++pass) {
    auto measured =
        chain::MeasureTargets(sightings, seen_through, {config.huber_sigma, config.reject_sigma});
    if (!measured) return Forward(measured);
    auto result = SolveHandEye(robot_poses, std::move(*measured), mount, config);
    if (!result || pass == num_passes) return result;
    seen_through.devices.camera = result->camera;
  }
}

}  // namespace fringe_fusion
