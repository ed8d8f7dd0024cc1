#include "chain_run.hpp"

#include <algorithm>
#include <cmath>

#include "common/constants.hpp"
#include "common/dense.hpp"
#include "common/median.hpp"

namespace fringe_fusion::chain {
namespace {

constexpr int kChainIterations = 60;
constexpr double kGoodStart = 2.0;  // median miss in standard deviations: no need to look further
constexpr int kRobustPasses = 12;
constexpr int kMaxChanges = 60;
constexpr int kScalePasses = 6;
constexpr double kMedianChi2Of6 = 5.348;
// Noise this far below the stated one still counts as the stated one: exact data have none at all.
constexpr double kMinNoiseRatio = 0.1;
// Stands for no tie at all in the covariance of a correction.
constexpr double kOpenRotationRad = 10.0;
constexpr double kOpenTranslationM = 100.0;

Matrix6d CovarianceOfCorrection(const Link& link) {
  Matrix6d information = link.information;
  information.diagonal().head<3>().array() += 1.0 / (kOpenRotationRad * kOpenRotationRad);
  information.diagonal().tail<3>().array() += 1.0 / (kOpenTranslationM * kOpenTranslationM);
  return dense::SolveSymmetric(information, Matrix6d::Identity());
}

double MedianMissOf(const ChainRun& run, const ChainState& state) {
  std::vector<double> squared;
  for (const std::size_t k : UsedPoses(run)) {
    squared.push_back(SquaredMiss(run, state, k, EndMatrix::Zero()));
  }
  return Median(std::move(squared));
}

/// Ends for a carrier: the target where the pose that most others agree with puts it.
ChainState BestStateFor(const ChainRun& run, const Transform& T_camera_carrier) {
  ChainState best;
  best.T_camera_carrier = T_camera_carrier;
  best.corrections.assign(run.chain.links.size(), Transform::Identity());
  double best_miss = kInfinity;
  ChainState state = best;
  for (const std::size_t k : UsedPoses(run)) {
    const Transform G = LinkMotion(run.chain, k, Transform::Identity());
    state.T_other_target = (T_camera_carrier * G).inverse() * run.measured.T_camera_target[k];
    const double miss = MedianMissOf(run, state);
    if (!(miss < best_miss)) continue;
    best_miss = miss;
    best = state;
  }
  return best;
}

/// Poses of little weight pull little: the start is close enough for all others to agree.
void SolveRobust(const TargetCost& target, ChainRun& run) {
  Chain chain = run.chain;
  for (int pass = 0; pass < kRobustPasses; ++pass) {
    const double scale2 =
        std::max(MedianMissOf(run, run.state) / kMedianChi2Of6, kMinNoiseRatio * kMinNoiseRatio);
    for (const std::size_t k : UsedPoses(run)) {
      const double miss2 = SquaredMiss(run, run.state, k, EndMatrix::Zero());
      chain.links[k].weight = 1.0 / (1.0 + miss2 / (4.0 * 6.0 * scale2));
    }
    if (!SolveChain(chain, target, run.state, 10)) return;
  }
}

void Exclude(ChainRun& run, std::size_t k, const std::string& reason) {
  run.chain.links[k].weight = 0.0;
  run.measured.reasons[k] = reason;
  run.state.corrections[k] = Transform::Identity();
}

/// Residual cost per degree of freedom of the poses that take part.
double NoiseRatio(const Chain& chain, const TargetCost& target, const ChainState& state) {
  double cost = 0.0;
  int num_used = 0;
  for (std::size_t k = 0; k < chain.links.size(); ++k) {
    if (!(chain.links[k].weight > 0.0)) continue;
    ++num_used;
    cost += target(k, PredictTarget(chain, state, k), state.lens).cost +
            CorrectionCost(chain.links[k], state.corrections[k]);
  }
  const double dof = std::max(1, 6 * num_used - static_cast<int>(chain.FreeEnds().size()));
  return std::max(std::sqrt(cost / dof), kMinNoiseRatio);
}

std::string ReasonOfMiss(const ChainRun& run, const ChainState& state, std::size_t k,
                         double ratio) {
  ChainState uncorrected = state;
  uncorrected.corrections[k] = Transform::Identity();
  const Transform T = PredictTarget(run.chain, uncorrected, k);
  const Transform& seen = run.measured.T_camera_target[k];
  const double angle = LogRotation(T.linear().transpose() * seen.linear()).norm();
  const double distance =
      (T * run.measured.middle_target - seen * run.measured.middle_target).norm();
  return fmt::format(
      "bad pose: predicted from the others it misses by {:.3f} deg and {:.3f} mm, {:.1f} times "
      "what the others leave (limit {})",
      angle * kDegPerRad, 1e3 * distance, ratio, run.limits.max_pose_ratio);
}

/// How far a pose lies from what the others predict for it; nothing where they cannot.
struct HeldOutLink {
  double ratio = 0.0;
  std::string reason;
};
std::optional<HeldOutLink> HoldOutLink(const ChainRun& run, const TargetCost& target,
                                       std::size_t k) {
  Chain others = run.chain;
  others.links[k].weight = 0.0;
  ChainState state = run.state;
  if (!SolveChain(others, target, state, 10)) return std::nullopt;
  const auto covariance = CovarianceOf(others, target, state);
  if (!covariance || !(covariance->condition < run.limits.max_condition)) return std::nullopt;
  HeldOutLink out;
  out.ratio = std::sqrt(SquaredMiss(run, state, k, covariance->ends) / 6.0) /
              NoiseRatio(others, target, state);
  out.reason = ReasonOfMiss(run, state, k, out.ratio);
  return out;
}

/// Leaves out what misses the robust solution, then judges every pose, in or out, by the others.
Status SelectPoses(const TargetCost& target, ChainRun& run) {
  const double scale = std::sqrt(
      std::max(MedianMissOf(run, run.state) / kMedianChi2Of6, kMinNoiseRatio * kMinNoiseRatio));
  const std::vector<std::size_t> candidates = UsedPoses(run);
  for (const std::size_t k : candidates) {
    const double miss = std::sqrt(SquaredMiss(run, run.state, k, EndMatrix::Zero()) / 6.0);
    if (miss / scale <= run.limits.max_pose_ratio) continue;
    Exclude(run, k, ReasonOfMiss(run, run.state, k, miss / scale));
  }
  for (int change = 0; change < kMaxChanges; ++change) {
    if (Status status = CheckNumUsed(run); !status) return status;
    if (!SolveChain(run.chain, target, run.state, kChainIterations)) {
      return Fail("the adjustment finds no finite step");
    }
    std::optional<std::size_t> worst;
    std::optional<std::size_t> best_out;
    std::string worst_reason;
    for (const std::size_t k : candidates) {
      const bool is_in = run.chain.links[k].weight > 0.0;
      const auto held_out = HoldOutLink(run, target, k);
      run.held_out_ratio[k] = held_out ? held_out->ratio : 0.0;
      if (!held_out) continue;
      const bool is_good = held_out->ratio <= run.limits.max_pose_ratio;
      if (is_in && !is_good && (!worst || held_out->ratio > run.held_out_ratio[*worst])) {
        worst = k;
        worst_reason = held_out->reason;
      }
      if (is_in) continue;
      run.measured.reasons[k] = held_out->reason;
      if (is_good && (!best_out || held_out->ratio < run.held_out_ratio[*best_out])) best_out = k;
    }
    if (worst) {
      Exclude(run, *worst, worst_reason);
    } else if (best_out) {
      run.chain.links[*best_out].weight = 1.0;
      run.measured.reasons[*best_out].clear();
    } else {
      return {};
    }
  }
  return {};
}

/// Squared corrections in units of their stated information and the rows that are left for them.
struct GroupSums {
  double chi2 = 0.0;
  double redundancy = 0.0;
};

std::array<GroupSums, 2> SumGroups(const ChainRun& run, const Chain& scaled) {
  std::array<GroupSums, 2> sums;
  for (const std::size_t k : UsedPoses(run)) {
    const Vector6d e = Log(run.state.corrections[k]);
    const Matrix6d& stated = run.chain.links[k].information;
    const Matrix6d share = scaled.links[k].information * run.covariance.corrections[k];
    for (int i = 0; i < 6; ++i) {
      if (!(stated(i, i) > 0.0)) continue;
      const int group = run.limits.groups[static_cast<std::size_t>(i)];
      GroupSums& sum = sums[static_cast<std::size_t>(group)];
      sum.redundancy += 1.0 - share(i, i);
      for (int j = 0; j < 6; ++j) {
        if (run.limits.groups[static_cast<std::size_t>(j)] == group) {
          sum.chi2 += e[i] * stated(i, j) * e[j];
        }
      }
    }
  }
  return sums;
}

void ApplyScales(const ChainRun& run, const std::array<double, 2>& scale, Chain& chain) {
  Vector6d weight;
  for (int i = 0; i < 6; ++i) {
    const auto group = static_cast<std::size_t>(run.limits.groups[static_cast<std::size_t>(i)]);
    weight[i] = 1.0 / scale[group];
  }
  for (std::size_t k = 0; k < chain.links.size(); ++k) {
    chain.links[k].information =
        weight.asDiagonal() * run.chain.links[k].information * weight.asDiagonal();
  }
}

Status SolveScaled(const TargetCost& target, const Chain& scaled, ChainRun& run) {
  if (!SolveChain(scaled, target, run.state, kChainIterations)) {
    return Fail("the adjustment finds no finite step");
  }
  auto covariance = CovarianceOf(scaled, target, run.state);
  if (!covariance) return Fail("the poses do not determine the result: the system is singular");
  run.covariance = std::move(*covariance);
  return {};
}

/// Variance components of the device: Helmert's estimate, applied only where it is significant,
/// so that chance does not widen what is stated.
Status FindScales(const TargetCost& target, ChainRun& run) {
  Chain scaled = run.chain;
  std::array<double, 2> scale{1.0, 1.0};
  std::array<bool, 2> is_significant{};
  for (int pass = 0; pass < kScalePasses; ++pass) {
    ApplyScales(run, scale, scaled);
    if (Status status = SolveScaled(target, scaled, run); !status) return status;
    const std::array<GroupSums, 2> sums = SumGroups(run, scaled);
    double change = 0.0;
    for (std::size_t group = 0; group < scale.size(); ++group) {
      const GroupSums& sum = sums[group];
      if (!(sum.redundancy > 1.0)) continue;
      const double factor2 = sum.chi2 / sum.redundancy;
      const double found = std::sqrt(std::max(factor2, kMinNoiseRatio * kMinNoiseRatio));
      change = std::max(change, std::abs(found / scale[group] - 1.0));
      scale[group] = found;
      is_significant[group] = factor2 > 1.0 + 2.0 * std::sqrt(2.0 / sum.redundancy);
    }
    if (change < 0.01) break;
  }
  for (std::size_t group = 0; group < scale.size(); ++group) {
    run.sigma_scale[group] = is_significant[group] ? scale[group] : 1.0;
  }
  ApplyScales(run, run.sigma_scale, scaled);
  return SolveScaled(target, scaled, run);
}

}  // namespace

int NumUsed(const ChainRun& run) {
  return static_cast<int>(std::count_if(run.chain.links.begin(), run.chain.links.end(),
                                        [](const Link& link) { return link.weight > 0.0; }));
}

std::vector<std::size_t> UsedPoses(const ChainRun& run) {
  std::vector<std::size_t> used;
  for (std::size_t k = 0; k < run.chain.links.size(); ++k) {
    if (run.chain.links[k].weight > 0.0) used.push_back(k);
  }
  return used;
}

std::string ReasonsOf(const ChainRun& run) {
  std::string text;
  for (std::size_t k = 0; k < run.names.size(); ++k) {
    if (run.measured.reasons[k].empty()) continue;
    text += fmt::format("; {}: {}", run.names[k], run.measured.reasons[k]);
  }
  return text;
}

Status CheckNumUsed(const ChainRun& run) {
  if (NumUsed(run) >= run.limits.min_poses) return {};
  return Fail("{} of {} poses are usable, {} are needed{}", NumUsed(run), run.names.size(),
              run.limits.min_poses, ReasonsOf(run));
}

double SquaredMiss(const ChainRun& run, const ChainState& state, std::size_t pose,
                   const EndMatrix& ends) {
  ChainState uncorrected = state;
  uncorrected.corrections[pose] = Transform::Identity();
  const LinkJacobian J = JacobianOf(run.chain, uncorrected, pose);
  const Vector6d miss = Log(run.measured.T_camera_target[pose].inverse() *
                            PredictTarget(run.chain, uncorrected, pose));
  const Matrix6d covariance = J.by_ends * ends * J.by_ends.transpose() +
                              J.by_correction * CovarianceOfCorrection(run.chain.links[pose]) *
                                  J.by_correction.transpose() +
                              run.measured.covariance[pose];
  return miss.dot(Vector6d(dense::SolveSymmetric(covariance, miss)));
}

Status RunChain(const std::vector<Transform>& candidates, ChainRun& run) {
  // Poses alone know nothing of the lens.
  const std::array<bool, kNumEnds> free_ends = run.chain.free;
  std::fill(run.chain.free.begin() + 12, run.chain.free.end(), false);
  run.held_out_ratio.assign(run.names.size(), 0.0);
  double best_miss = kInfinity;
  for (const Transform& T_camera_carrier : candidates) {
    const ChainState state = BestStateFor(run, T_camera_carrier);
    const double miss = MedianMissOf(run, state);
    if (!(miss < best_miss)) continue;
    best_miss = miss;
    run.state = state;
    if (miss <= kGoodStart * kGoodStart * kMedianChi2Of6) break;
  }
  if (!std::isfinite(best_miss)) return Fail("no start: the poses do not determine one");
  const TargetCost by_poses = PoseCostOf(run.measured);
  SolveRobust(by_poses, run);
  if (Status status = SelectPoses(by_poses, run); !status) return status;
  if (!run.measured.points) return FindScales(by_poses, run);
  run.chain.free = free_ends;
  const CameraModel stated = run.measured.points->state.devices[bundle::kCamera];
  return FindScales(PointCostOf(*run.measured.points, stated), run);
}

std::vector<DevicePoseOutcome> OutcomesOf(ChainRun& run) {
  std::vector<DevicePoseOutcome> outcomes;
  for (std::size_t k = 0; k < run.names.size(); ++k) {
    DevicePoseOutcome out;
    out.name = run.names[k];
    out.used = run.chain.links[k].weight > 0.0;
    out.reason = run.measured.reasons[k];
    out.T_camera_target = run.measured.T_camera_target[k];
    out.covariance = run.measured.covariance[k];
    out.correction = Log(run.state.corrections[k]);
    out.held_out_ratio = run.held_out_ratio[k];
    out.num_rejected_points = run.measured.num_rejected_points[k];
    ChainState uncorrected = run.state;
    uncorrected.corrections[k] = Transform::Identity();
    const Transform T = PredictTarget(run.chain, uncorrected, k);
    const Eigen::Vector3d& middle = run.measured.middle_target;
    out.rotation_miss_rad =
        LogRotation(T.linear().transpose() * out.T_camera_target.linear()).norm();
    out.translation_miss_m = (T * middle - out.T_camera_target * middle).norm();
    if (out.used && run.measured.points) {
      PointModel& points = *run.measured.points;
      points.state.blocks[k].T_camera_target = PredictTarget(run.chain, run.state, k);
      const bundle::StationSums sums = points.problem.Sum(points.state, points.options, k);
      double sum_px2 = 0.0;
      for (const bundle::DeviceSums& device : sums.devices) {
        sum_px2 += device.sum_px2;
        out.num_points += device.count;
      }
      out.rms_px = out.num_points > 0 ? std::sqrt(sum_px2 / out.num_points) : 0.0;
    }
    outcomes.push_back(std::move(out));
  }
  return outcomes;
}

double RmsOfPoints(const std::vector<DevicePoseOutcome>& outcomes) {
  double sum_px2 = 0.0;
  int count = 0;
  for (const DevicePoseOutcome& pose : outcomes) {
    sum_px2 += pose.num_points * pose.rms_px * pose.rms_px;
    count += pose.num_points;
  }
  return count > 0 ? std::sqrt(sum_px2 / count) : 0.0;
}

Eigen::Matrix3d CovarianceOfPoint(const Matrix6d& covariance, const Eigen::Vector3d& point) {
  Eigen::Matrix<double, 3, 6> J;
  J << -Hat(point), Eigen::Matrix3d::Identity();
  return J * covariance * J.transpose();
}

}  // namespace fringe_fusion::chain
