#include <algorithm>
#include <cmath>
#include <limits>

#include "cell_run.hpp"
#include "common/constants.hpp"
#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::bundle {
namespace {

/// With so few blocks one step of the normal equations is not close enough.
constexpr std::size_t kFewBlocks = 8;
constexpr int kResolveIterations = 10;
constexpr int kPoseIterations = 5;

/// Solves without one station, from scratch.
std::optional<State> SolveWithout(const CellProblem& problem, const State& state,
                                  const Options& options, std::size_t station) {
  CellProblem others = problem;
  others.stations()[station].seen = {};
  State moved = state;
  if (!others.Solve(moved, options, kResolveIterations)) return std::nullopt;
  return moved;
}

/// One Gauss-Newton step of the system from which the block's share is taken.
std::optional<State> StepWithout(const State& state, const Options& options, const Reduced& reduced,
                                 std::size_t block) {
  const auto step = SolveFree(reduced.hessian - reduced.share_hessian[block],
                              reduced.gradient - reduced.share_gradient[block],
                              FreeIndices(options, reduced.gradient.size()));
  if (!step) return std::nullopt;
  State moved = state;
  MoveShared(moved, step->head<kNumCellParameters>());
  if (options.free_points) {
    for (std::size_t j = 0; j < moved.points_target.size(); ++j) {
      moved.points_target[j] +=
          step->segment<3>(kNumCellParameters + 3 * static_cast<Eigen::Index>(j));
    }
  }
  return moved;
}

bool IsIn(const Station& station) { return !station.seen[kCamera].empty(); }

HeldOutPose Judged(const StationSums& sums) {
  HeldOutPose pose;
  pose.devices = sums.devices;
  pose.cost = sums.cost;
  const int dof = 2 * (sums.devices[kCamera].count + sums.devices[kProjector].count) - 6;
  pose.ratio =
      std::sqrt((sums.devices[kCamera].chi2 + sums.devices[kProjector].chi2) / std::max(1, dof));
  return pose;
}

}  // namespace

std::vector<std::optional<HeldOutPose>> HoldOut(const CellProblem& problem, const State& state,
                                                const Options& options) {
  const std::vector<Station>& stations = problem.stations();
  std::vector<std::optional<HeldOutPose>> poses(stations.size());
  Reduced reduced = problem.Reduce(state, options, 0.0);
  for (Eigen::MatrixXd& share : reduced.share_hessian) {
    share.triangularView<Eigen::StrictlyLower>() = share.transpose();
  }
  const auto num_in =
      static_cast<std::size_t>(std::count_if(stations.begin(), stations.end(), IsIn));
  ParallelFor(static_cast<int>(stations.size()), 1, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      if (!IsIn(stations[i]) || stations[i].shift >= 0) continue;
      std::optional<State> moved = num_in <= kFewBlocks
                                       ? SolveWithout(problem, state, options, i)
                                       : StepWithout(state, options, reduced, stations[i].block);
      if (!moved) continue;
      moved->blocks[stations[i].block] = state.blocks[stations[i].block];
      problem.FitPose(*moved, options, i, kPoseIterations);
      Options own = options;
      own.free_points = false;
      const StationSums sums = problem.Sum(*moved, own, i);
      if (std::isfinite(sums.cost)) poses[i] = Judged(sums);
    }
  });
  return poses;
}

void SetLevels(CellRun& run, DistortionLevel camera, DistortionLevel projector) {
  run.camera = camera;
  run.projector = projector;
  run.options.free = MaskOf(camera, projector);
  for (std::size_t device = 0; device < 2; ++device) {
    for (std::size_t k = 0; k < 5; ++k) {
      if (!run.options.free[device * kNumModel + 4 + k])
        run.state.devices[device].distortion[k] = 0.0;
    }
  }
}

namespace {

/// rms of distances over both devices.
double JointRms(const std::array<DeviceSums, 2>& sums) {
  const int count = sums[kCamera].count + sums[kProjector].count;
  return std::sqrt((sums[kCamera].sum_px2 + sums[kProjector].sum_px2) / std::max(1, count));
}

/// Solves one model and predicts every pose with it. The run keeps its solution.
ModelTrial Try(CellRun& run, DistortionLevel camera, DistortionLevel projector) {
  SetLevels(run, camera, projector);
  ModelTrial trial;
  trial.camera = camera;
  trial.projector = projector;
  trial.held_out_cost = kInfinity;
  if (!run.problem.Solve(run.state, run.options, 20)) return trial;
  trial.rms_px = JointRms(run.problem.Sums(run.state, run.options));
  std::array<DeviceSums, 2> held_out;
  double cost = 0.0;
  const auto poses = HoldOut(run.problem, run.state, run.options);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!IsIn(run.problem.stations()[i]) || run.problem.stations()[i].shift >= 0) continue;
    if (!poses[i]) return trial;
    for (std::size_t device = 0; device < 2; ++device) {
      held_out[device].Add(poses[i]->devices[device]);
    }
    cost += poses[i]->cost;
  }
  if (held_out[kCamera].count == 0) return trial;
  trial.held_out_rms_px = JointRms(held_out);
  trial.held_out_cost = cost;
  return trial;
}

constexpr std::array<DistortionLevel, 5> kLevels = {
    DistortionLevel::kNone, DistortionLevel::kK1, DistortionLevel::kK1K2,
    DistortionLevel::kTangential, DistortionLevel::kAll};

}  // namespace

void ChooseLevels(CellRun& run) {
  const bool fixed_camera = run.config.distortion_camera >= 0;
  const bool fixed_projector = run.config.distortion_projector >= 0;
  ModelTrial best;
  best.camera = fixed_camera ? static_cast<DistortionLevel>(run.config.distortion_camera)
                             : DistortionLevel::kK1K2;
  best.projector = fixed_projector ? static_cast<DistortionLevel>(run.config.distortion_projector)
                                   : DistortionLevel::kK1K2;
  best = Try(run, best.camera, best.projector);
  run.trials = {best};
  const auto consider = [&](DistortionLevel camera, DistortionLevel projector) {
    for (const ModelTrial& known : run.trials) {
      if (known.camera == camera && known.projector == projector) return;
    }
    run.trials.push_back(Try(run, camera, projector));
    if (run.trials.back().held_out_cost < best.held_out_cost) best = run.trials.back();
  };
  // One device after the other: their distortions hardly know of each other.
  if (!fixed_camera) {
    for (const DistortionLevel level : kLevels) consider(level, best.projector);
  }
  if (!fixed_projector) {
    for (const DistortionLevel level : kLevels) consider(best.camera, level);
  }
  SetLevels(run, best.camera, best.projector);
  (void)run.problem.Solve(run.state, run.options, 50);
}

}  // namespace fringe_fusion::bundle
