#include "fringe_fusion/calibration/calibrate_cell.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cell_run.hpp"
#include "common/constants.hpp"
#include "common/dense.hpp"

namespace fringe_fusion {
namespace {

using namespace bundle;  // NOLINT(google-build-using-namespace): the steps of this one solver

constexpr std::array<const char*, 9> kModelNames = {"fx", "fy", "cx", "cy", "k1",
                                                    "k2", "p1", "p2", "k3"};
constexpr std::array<const char*, 6> kPoseNames = {
    "rotation x", "rotation y", "rotation z", "translation x", "translation y", "translation z"};

std::string Reasons(const CellRun& run) {
  std::string text;
  for (std::size_t i = 0; i < run.reasons.size(); ++i) {
    if (run.reasons[i].empty()) continue;
    text += fmt::format("; {}: {}", run.names[i], run.reasons[i]);
  }
  return text;
}

Status CheckNumPoses(const CellRun& run) {
  const bool has_code = NumPoints(run)[kProjector] > 0;
  if (NumPoses(run) >= run.config.min_poses && has_code) return {};
  return Fail("{} of {} poses are usable, {} are needed{}{}", NumPoses(run), run.names.size(),
              run.config.min_poses,
              has_code || run.names.empty() ? "" : ", and the projector's code is missing in all",
              Reasons(run));
}

Status CheckDistance(const CellRun& run, const CalibrationTarget& target) {
  std::vector<double> distances;
  for (const Station& station : run.problem.stations()) {
    if (station.seen[kCamera].empty()) continue;
    distances.push_back(run.state.blocks[station.block].T_camera_target.translation().norm());
  }
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  if (*middle >= run.config.min_distance_m && *middle <= run.config.max_distance_m) return {};
  return Fail(
      "with a pitch of {} m the target stands {:.4g} m away, limits {} to {} m: is its size in "
      "another unit?",
      target.pitch_m, *middle, run.config.min_distance_m, run.config.max_distance_m);
}

bool HasStage(const CellRun& run) {
  return std::any_of(run.problem.stations().begin(), run.problem.stations().end(),
                     [](const Station& s) { return s.shift >= 0; });
}

Status CheckTilt(const CellRun& run) {
  const double tilt_deg = MaxTiltDeg(run);
  if (tilt_deg >= run.config.min_tilt_deg || HasStage(run)) return {};
  return Fail(
      "all poses of the target are parallel within {:.2f} deg, at least {} deg are needed: "
      "parallel "
      "planes do not tell the focal length from the distance; tilt the target",
      tilt_deg, run.config.min_tilt_deg);
}

/// Covariance of the reduced system, zero for what is held; and the condition of its correlation.
struct SharedCovariance {
  Eigen::MatrixXd covariance;
  double condition = kInfinity;
  std::string weakest;  ///< names of the parameters that cannot be told apart
};

SharedCovariance Invert(const Reduced& reduced, const Options& options) {
  SharedCovariance out;
  const Eigen::Index size = reduced.gradient.size();
  const std::vector<Eigen::Index> free = FreeIndices(options, size);
  const auto num_free = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd part = reduced.hessian(free, free);
  const Eigen::VectorXd scale = part.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  part = scale.asDiagonal() * part * scale.asDiagonal();
  const auto num_cell =
      static_cast<Eigen::Index>(std::count(options.free.begin(), options.free.end(), true));
  const dense::SymmetricEigen eigen =
      dense::DecomposeSymmetric(part.topLeftCorner(num_cell, num_cell));
  out.condition = eigen.values[0] > 0.0 ? eigen.values[num_cell - 1] / eigen.values[0] : kInfinity;
  std::vector<Eigen::Index> order;
  for (Eigen::Index i = 0; i < num_cell; ++i) order.push_back(i);
  const Eigen::VectorXd weakest = eigen.vectors.col(0).cwiseAbs();
  std::sort(order.begin(), order.end(),
            [&](Eigen::Index a, Eigen::Index b) { return weakest[a] > weakest[b]; });
  for (std::size_t k = 0; k < 3 && k < order.size(); ++k) {
    out.weakest +=
        fmt::format("{}{}", k > 0 ? ", " : "",
                    CellParameterName(static_cast<int>(free[static_cast<std::size_t>(order[k])])));
  }
  out.covariance = Eigen::MatrixXd::Zero(size, size);
  const auto inverse = dense::SolvePositive(part, Eigen::MatrixXd::Identity(num_free, num_free));
  if (!inverse) {
    out.condition = kInfinity;
    return out;
  }
  out.covariance(free, free) = scale.asDiagonal() * *inverse * scale.asDiagonal();
  return out;
}

Result<CellRun> StartRun(const CalibrationTarget& target,
                         const std::vector<TargetSighting>& sightings, const DeviceSizes& sizes,
                         const CalibrationConfig& config, const std::vector<StageStation>& stage) {
  auto data = ScreenSightings(target, sightings, stage, config);
  if (!data) return Forward(data);
  CellRun run{config,
              sizes,
              {},
              data->reasons,
              CellProblem(data->stations, data->points, data->nominal_shifts),
              {},
              {},
              DistortionLevel::kK1K2,
              DistortionLevel::kK1K2,
              {},
              std::vector<double>(sightings.size(), 0.0),
              {}};
  for (const TargetSighting& sighting : sightings) run.names.push_back(sighting.name);
  if (Status s = CheckNumPoses(run); !s) return tl::unexpected<Error>(s.error());
  auto state = StartCell(*data, sizes);
  if (!state) return Fail("{}{}", state.error().message, Reasons(run));
  run.state = std::move(*state);
  run.options.huber_sigma = config.huber_sigma;
  run.options.sigma_shift_m = config.sigma_stage_m;
  return run;
}

/// Adjusts everything and takes out what does not fit.
Status SolveRun(CellRun& run, const CalibrationTarget& target) {
  const auto level = [](int wanted) {
    return wanted >= 0 ? static_cast<DistortionLevel>(wanted) : DistortionLevel::kK1K2;
  };
  SetLevels(run, level(run.config.distortion_camera), level(run.config.distortion_projector));
  SetRobustScale(run);
  if (!run.problem.Solve(run.state, run.options, kSolveIterations)) {
    return Fail("the adjustment finds no start with all targets before both devices");
  }
  if (Status s = CheckDistance(run, target); !s) return s;
  if (Status s = CheckTilt(run); !s) return s;
  SetRobustScale(run);
  (void)run.problem.Solve(run.state, run.options, kSolveIterations);
  RejectPoses(run);
  // From all points, not from the median: what bends the whole must not trim itself away.
  SetScale(run);
  for (int pass = 0; pass < 5 && RejectPoints(run); ++pass) SetScale(run);
  if (Status s = CheckNumPoses(run); !s) return s;
  SetScale(run);
  ChooseLevels(run);
  if (target.sigma_print_m > 0.0) {
    run.options.free_points = true;
    run.options.sigma_point_m = target.sigma_print_m;
    (void)run.problem.Solve(run.state, run.options, kSolveIterations);
  }
  SetScale(run);
  for (int pass = 0; pass < 3 && RejectPoints(run); ++pass) SetScale(run);
  if (Status s = CheckNumPoses(run); !s) return s;
  return CheckTilt(run);
}

double Rms(double sum_px2, int count) { return count > 0 ? std::sqrt(sum_px2 / count) : 0.0; }

void FillResiduals(const CellRun& run, CellCalibrationResult& result) {
  std::array<DeviceSums, 2> total;
  const std::vector<Station>& stations = run.problem.stations();
  for (std::size_t i = 0; i < stations.size(); ++i) {
    PoseOutcome& pose = result.poses[i];
    std::array<DeviceSums, 2> sums;
    for (const std::size_t device : {kCamera, kProjector}) {
      for (const Observation& seen : stations[i].seen[device]) {
        const Residual at = CellProblem::Miss(run.state, stations[i], seen, device, run.options);
        result.residuals.push_back(
            {static_cast<int>(i), seen.point, device == kProjector, seen.pixel, -at.residual_px});
        sums[device].Add({0.0, at.residual_px.squaredNorm(), 1});
      }
      total[device].Add(sums[device]);
    }
    pose.rms_camera_px = Rms(sums[kCamera].sum_px2, sums[kCamera].count);
    pose.rms_projector_px = Rms(sums[kProjector].sum_px2, sums[kProjector].count);
    pose.num_points_camera = sums[kCamera].count;
    pose.num_points_projector = sums[kProjector].count;
  }
  result.rms_camera_px = Rms(total[kCamera].sum_px2, total[kCamera].count);
  result.rms_projector_px = Rms(total[kProjector].sum_px2, total[kProjector].count);
  result.rms_joint_px = Rms(total[kCamera].sum_px2 + total[kProjector].sum_px2,
                            total[kCamera].count + total[kProjector].count);
  result.calibration.rms_px = result.rms_joint_px;
}

void FillPoses(const CellRun& run, CellCalibrationResult& result) {
  const std::vector<Station>& stations = run.problem.stations();
  for (std::size_t i = 0; i < stations.size(); ++i) {
    PoseOutcome pose;
    pose.name = run.names[i];
    pose.reason = run.reasons[i];
    pose.used = !stations[i].seen[kCamera].empty();
    const PoseBlock& block = run.state.blocks[stations[i].block];
    pose.T_camera_target = block.T_camera_target;
    pose.held_out_ratio = run.held_out_ratio[i];
    result.poses.push_back(std::move(pose));
    result.stage_shifts_m.push_back(
        stations[i].shift >= 0 ? block.shifts_m[static_cast<std::size_t>(stations[i].shift)]
                               : Eigen::Vector3d::Zero());
  }
}

/// The covariance of everything: shared parameters and the poses that take part.
void FillCovariance(const CellRun& run, const Reduced& reduced, const SharedCovariance& shared,
                    CellCalibrationResult& result) {
  result.covariance = shared.covariance.topLeftCorner<kNumCellParameters, kNumCellParameters>();
  const std::vector<Station>& stations = run.problem.stations();
  std::vector<std::size_t> used;
  std::vector<Eigen::MatrixXd> coupling;  // dpose = -W dshared
  for (std::size_t i = 0; i < stations.size(); ++i) {
    if (!result.poses[i].used) continue;
    used.push_back(i);
    const std::size_t b = stations[i].block;
    coupling.push_back(
        dense::Product(reduced.block_inverse[b].topRows(6), reduced.block_coupling[b]));
  }
  const auto num_used = static_cast<Eigen::Index>(used.size());
  Eigen::MatrixXd& joint = result.joint_covariance;
  joint =
      Eigen::MatrixXd::Zero(kNumCellParameters + 6 * num_used, kNumCellParameters + 6 * num_used);
  joint.topLeftCorner<kNumCellParameters, kNumCellParameters>() = result.covariance;
  for (std::size_t k = 0; k < used.size(); ++k) {
    const Eigen::Index at = kNumCellParameters + 6 * static_cast<Eigen::Index>(k);
    const Eigen::MatrixXd cross = -dense::Product(coupling[k], shared.covariance);
    joint.block<6, kNumCellParameters>(at, 0) = cross.leftCols<kNumCellParameters>();
    joint.block<kNumCellParameters, 6>(0, at) = cross.leftCols<kNumCellParameters>().transpose();
    for (std::size_t m = 0; m <= k; ++m) {
      const Eigen::Index other = kNumCellParameters + 6 * static_cast<Eigen::Index>(m);
      Matrix6d block = -dense::Product(cross, coupling[m].transpose());
      if (stations[used[m]].block == stations[used[k]].block) {
        block += reduced.block_inverse[stations[used[k]].block].topLeftCorner<6, 6>();
      }
      joint.block<6, 6>(at, other) = block;
      joint.block<6, 6>(other, at) = block.transpose();
    }
    result.poses[used[k]].covariance = joint.block<6, 6>(at, at);
  }
}

Result<CellCalibrationResult> Finish(const CellRun& run) {
  const Reduced reduced = run.problem.Reduce(run.state, run.options, 0.0);
  const SharedCovariance shared = Invert(reduced, run.options);
  if (!(shared.condition <= run.config.max_condition)) {
    return Fail(
        "the poses do not determine the cell: condition number {:.3g}, limit {:.3g}; {} cannot be "
        "told apart: vary tilt and distance of the target",
        shared.condition, run.config.max_condition, shared.weakest);
  }
  CellCalibrationResult result;
  result.calibration.camera = run.state.devices[kCamera];
  result.calibration.projector = run.state.devices[kProjector];
  result.calibration.T_projector_camera = run.state.T_projector_camera;
  result.condition = shared.condition;
  result.distortion_camera = run.camera;
  result.distortion_projector = run.projector;
  result.trials = run.trials;
  result.rejected = run.rejected;
  result.target_points = run.state.points_target;
  result.sigma_scale_camera = run.options.scale[kCamera];
  result.sigma_scale_projector = run.options.scale[kProjector];
  FillPoses(run, result);
  FillResiduals(run, result);
  FillCovariance(run, reduced, shared, result);
  if (Status s = Validate(result.calibration, "calibration"); !s) {
    return tl::unexpected<Error>(s.error());
  }
  result.coverage = AssessCoverage(run);
  result.next = SuggestNextPose(run, result.covariance, result.coverage);
  result.verdict = Judge(run, result, result.next.error_before_m);
  return result;
}

}  // namespace

std::string DistortionName(DistortionLevel level) {
  constexpr std::array<const char*, 5> kNames = {"none", "k1", "k1 k2", "k1 k2 p1 p2",
                                                 "k1 k2 p1 p2 k3"};
  return kNames[static_cast<std::size_t>(level)];
}

std::string CellParameterName(int parameter) {
  const auto i = static_cast<std::size_t>(parameter);
  if (i < 9) return fmt::format("camera {}", kModelNames[i]);
  if (i < 18) return fmt::format("projector {}", kModelNames[i - 9]);
  return fmt::format("T_projector_camera {}", kPoseNames[i - 18]);
}

std::array<double, kNumCellParameters> CellParameterValues(const CellCalibration& calibration) {
  std::array<double, kNumCellParameters> values{};
  std::size_t i = 0;
  for (const CameraModel* model : {&calibration.camera, &calibration.projector}) {
    for (const double value : {model->fx, model->fy, model->cx, model->cy}) values[i++] = value;
    for (const double value : model->distortion) values[i++] = value;
  }
  const Eigen::AngleAxisd turn(calibration.T_projector_camera.linear());
  for (const double value : Eigen::Vector3d(turn.angle() * turn.axis())) values[i++] = value;
  for (const double value : Eigen::Vector3d(calibration.T_projector_camera.translation())) {
    values[i++] = value;
  }
  return values;
}

Result<CellCalibrationResult> CalibrateCell(const CalibrationTarget& target,
                                            const std::vector<TargetSighting>& sightings,
                                            const DeviceSizes& sizes,
                                            const CalibrationConfig& config,
                                            const std::vector<StageStation>& stage) {
  if (Status s = CheckBounds(config, "calibration"); !s) return tl::unexpected<Error>(s.error());
  auto run = StartRun(target, sightings, sizes, config, stage);
  if (!run) return Forward(run);
  if (Status s = SolveRun(*run, target); !s) return tl::unexpected<Error>(s.error());
  return Finish(*run);
}

}  // namespace fringe_fusion
