#include <algorithm>
#include <cmath>

#include "cell_run.hpp"
#include "common/median.hpp"

namespace fringe_fusion::bundle {
namespace {

int NumFree(const CellRun& run) {
  return static_cast<int>(std::count(run.options.free.begin(), run.options.free.end(), true)) +
         6 * NumPoses(run);
}

void Apply(CellRun& run, std::size_t device, double factor) {
  double& scale = run.options.scale[device];
  scale *= factor;
  // Residuals below the stated noise are no reason to promise more than was stated.
  if (!run.config.equal_weights) scale = std::max(1.0, scale);
}

void RemoveStation(CellRun& run, std::size_t i, std::string reason) {
  run.problem.stations()[i].seen = {};
  run.reasons[i] = std::move(reason);
}

/// rms of the whitened residuals of all stations over its expectation.
double WhitenedRms(const CellProblem& problem, const State& state, const Options& options,
                   int num_free) {
  const auto sums = problem.Sums(state, options);
  const int dof = 2 * (sums[kCamera].count + sums[kProjector].count) - num_free;
  return std::sqrt((sums[kCamera].chi2 + sums[kProjector].chi2) / std::max(1, dof));
}

double RmsPx(const DeviceSums& sums) {
  return sums.count > 0 ? std::sqrt(sums.sum_px2 / sums.count) : 0.0;
}

}  // namespace

int NumPoses(const CellRun& run) {
  return static_cast<int>(std::count_if(run.problem.stations().begin(),
                                        run.problem.stations().end(),
                                        [](const Station& s) { return !s.seen[kCamera].empty(); }));
}

std::array<int, 2> NumPoints(const CellRun& run) {
  std::array<int, 2> num{};
  for (const Station& station : run.problem.stations()) {
    for (std::size_t device = 0; device < 2; ++device) {
      num[device] += static_cast<int>(station.seen[device].size());
    }
  }
  return num;
}

void SetRobustScale(CellRun& run) {
  for (const std::size_t device : {kCamera, kProjector}) {
    std::vector<double> components;
    for (const Station& station : run.problem.stations()) {
      for (const Observation& seen : station.seen[device]) {
        const Eigen::Vector2d e =
            CellProblem::Miss(run.state, station, seen, device, run.options).e;
        components.push_back(std::abs(e.x()));
        components.push_back(std::abs(e.y()));
      }
    }
    constexpr double kNormalMad = 1.4826;
    if (!components.empty()) Apply(run, device, kNormalMad * Median(std::move(components)) + 1e-9);
  }
}

void SetScale(CellRun& run) {
  for (int pass = 0; pass < 3; ++pass) {
    const auto sums = run.problem.Sums(run.state, run.options);
    const double count = sums[kCamera].count + sums[kProjector].count;
    const double share = 2.0 * count > NumFree(run) ? 1.0 - NumFree(run) / (2.0 * count) : 1.0;
    for (const std::size_t device : {kCamera, kProjector}) {
      if (sums[device].count == 0) continue;
      Apply(run, device, std::sqrt(sums[device].chi2 / (2.0 * sums[device].count * share)) + 1e-9);
    }
    (void)run.problem.Solve(run.state, run.options, kSolveIterations);
  }
}

void RejectPoses(CellRun& run) {
  run.held_out_ratio.assign(run.names.size(), 0.0);
  while (NumPoses(run) > std::max(3, run.config.min_poses)) {
    const auto held_out = HoldOut(run.problem, run.state, run.options);
    std::size_t worst = held_out.size();
    for (std::size_t i = 0; i < held_out.size(); ++i) {
      if (!held_out[i]) continue;
      run.held_out_ratio[i] = held_out[i]->ratio;
      if (worst == held_out.size() || held_out[i]->ratio > held_out[worst]->ratio) worst = i;
    }
    if (worst == held_out.size()) return;
    CellProblem others = run.problem;
    others.stations()[worst].seen = {};
    State state = run.state;
    if (!others.Solve(state, run.options, kSolveIterations)) return;
    const double rest = WhitenedRms(others, state, run.options, NumFree(run) - 6);
    const double ratio = held_out[worst]->ratio / std::max(rest, 1e-9);
    if (!(ratio > run.config.max_pose_ratio)) return;
    RemoveStation(
        run, worst,
        fmt::format("bad pose: predicted from the others it misses by {:.2f} px in the "
                    "camera and {:.2f} px in the projector, {:.1f} times what the others "
                    "leave (limit {})",
                    RmsPx(held_out[worst]->devices[kCamera]),
                    RmsPx(held_out[worst]->devices[kProjector]), ratio, run.config.max_pose_ratio));
    run.state = std::move(state);
    SetRobustScale(run);
    (void)run.problem.Solve(run.state, run.options, kSolveIterations);
  }
}

bool RejectPoints(CellRun& run) {
  bool any = false;
  std::vector<Station>& stations = run.problem.stations();
  for (std::size_t i = 0; i < stations.size(); ++i) {
    for (const std::size_t device : {kCamera, kProjector}) {
      std::vector<Observation>& seen = stations[i].seen[device];
      std::vector<Observation> good;
      std::vector<RejectedPoint> bad;
      for (const Observation& observation : seen) {
        const Residual at =
            CellProblem::Miss(run.state, stations[i], observation, device, run.options);
        if (at.e.norm() <= run.config.reject_sigma) {
          good.push_back(observation);
        } else {
          bad.push_back({static_cast<int>(i), observation.point, device == kProjector,
                         at.residual_px.norm(), at.e.norm()});
        }
      }
      if (bad.empty()) continue;
      any = true;
      const auto num_bad = static_cast<double>(bad.size());
      if (num_bad > run.config.max_rejected_ratio * static_cast<double>(seen.size())) {
        RemoveStation(
            run, i,
            fmt::format("bad pose: {} of {} points in the {} miss their prediction by "
                        "more than {} standard deviations",
                        bad.size(), seen.size(), device == kCamera ? "camera" : "projector",
                        run.config.reject_sigma));
        break;
      }
      seen = std::move(good);
      run.rejected.insert(run.rejected.end(), bad.begin(), bad.end());
    }
  }
  if (any) (void)run.problem.Solve(run.state, run.options, kSolveIterations);
  return any;
}

}  // namespace fringe_fusion::bundle
