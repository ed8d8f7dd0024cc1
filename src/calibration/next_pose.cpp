#include <algorithm>
#include <cmath>
#include <limits>

#include "cell_run.hpp"
#include "common/dense.hpp"
#include "fringe_fusion/calibration/error_field.hpp"

namespace fringe_fusion::bundle {
namespace {

constexpr double kDeg = 3.14159265358979323846 / 180.0;
constexpr double kTiltRad = 30.0 * kDeg;
constexpr std::size_t kFieldPoints = 60;
constexpr double kMinVisibleRatio = 0.6;  ///< of the target, by both devices

using PointJacobian = Eigen::Matrix<double, 3, kNumCellParameters>;

struct Candidate {
  Transform T_camera_target = Transform::Identity();
  int column = 0;  ///< -1, 0, 1: where in the image
  int row = 0;
  int depth = 0;               ///< -1 near, 1 far
  Eigen::Vector2i tilt{0, 0};  ///< about x and y
};

struct DepthRange {
  double near_m = 0.0;
  double far_m = 0.0;
};

std::vector<Eigen::Vector3d> UsedPoints(const CellRun& run) {
  std::vector<Eigen::Vector3d> points;
  for (const Station& station : run.problem.stations()) {
    const PoseBlock& block = run.state.blocks[station.block];
    for (const Observation& seen : station.seen[kCamera]) {
      Eigen::Vector3d point = run.state.points_target[static_cast<std::size_t>(seen.point)];
      if (station.shift >= 0) point += block.shifts_m[static_cast<std::size_t>(station.shift)];
      points.push_back(block.T_camera_target * point);
    }
  }
  return points;
}

/// How the points of the volume move with the parameters.
std::vector<PointJacobian> FieldJacobians(const CellRun& run,
                                          const std::vector<Eigen::Vector3d>& points) {
  CellCalibration cell;
  cell.camera = run.state.devices[kCamera];
  cell.projector = run.state.devices[kProjector];
  cell.T_projector_camera = run.state.T_projector_camera;
  std::vector<PointJacobian> jacobians;
  const std::size_t step = std::max<std::size_t>(1, points.size() / kFieldPoints);
  for (std::size_t i = 0; i < points.size(); i += step) {
    const auto jacobian = PointByParameters(cell, points[i], {});
    if (jacobian) jacobians.push_back(*jacobian);
  }
  return jacobians;
}

double MeanError(const std::vector<PointJacobian>& jacobians, const CellCovariance& covariance) {
  double sum = 0.0;
  for (const PointJacobian& G : jacobians) {
    sum += (G * covariance).cwiseProduct(G).sum();
  }
  return std::sqrt(sum / (3.0 * static_cast<double>(std::max<std::size_t>(1, jacobians.size()))));
}

std::vector<Candidate> Candidates(const CellRun& run, const DepthRange& range) {
  const CameraModel& camera = run.state.devices[kCamera];
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : run.state.points_target) {
    middle += p / static_cast<double>(run.state.points_target.size());
  }
  std::vector<Candidate> candidates;
  const std::vector<Eigen::Vector2i> tilts = {{0, 0}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}};
  for (int depth = -1; depth <= 1; ++depth) {
    const double z = 0.5 * ((1 - depth) * range.near_m + (1 + depth) * range.far_m);
    for (int row = -1; row <= 1; ++row) {
      for (int column = -1; column <= 1; ++column) {
        const Eigen::Vector2d pixel((0.5 + 0.28 * column) * camera.width,
                                    (0.5 + 0.28 * row) * camera.height);
        const Eigen::Vector2d ray = Undistort(camera, pixel);
        if (!ray.allFinite()) continue;
        for (const Eigen::Vector2i& tilt : tilts) {
          Candidate candidate{Transform::Identity(), column, row, depth, tilt};
          candidate.T_camera_target.linear() =
              ExpRotation(kTiltRad * Eigen::Vector3d(tilt.x(), tilt.y(), 0.0));
          candidate.T_camera_target.translation() =
              z * ray.homogeneous() - candidate.T_camera_target.linear() * middle;
          candidates.push_back(candidate);
        }
      }
    }
  }
  return candidates;
}

/// Typical whitener of a device: its deviations are those of the points seen so far.
double TypicalWeight(const CellRun& run, std::size_t device) {
  double sum = 0.0;
  double count = 0.0;
  for (const Station& station : run.problem.stations()) {
    for (const Observation& seen : station.seen[device]) {
      sum += 0.5 * seen.whitener.squaredNorm();
      count += 1.0;
    }
  }
  return count > 0.0 ? std::sqrt(sum / count) : 1.0;
}

void AddVisible(const State& state, const std::array<double, 2>& weights, std::size_t device,
                Station& station) {
  const CameraModel& model = state.devices[device];
  for (std::size_t j = 0; j < state.points_target.size(); ++j) {
    Eigen::Vector3d point = state.blocks[0].T_camera_target * state.points_target[j];
    if (device == kProjector) point = state.T_projector_camera * point;
    if (!(point.z() > 0.0)) continue;
    const Eigen::Vector2d pixel = Project(model, point);
    if (!(pixel.minCoeff() > 0.0) || !(pixel.x() < model.width - 1) ||
        !(pixel.y() < model.height - 1)) {
      continue;
    }
    Observation seen;
    seen.point = static_cast<int>(j);
    seen.pixel = pixel;
    seen.whitener *= weights[device];
    station.seen[device].push_back(seen);
  }
}

/// Information of a pose on the 24 parameters, its own six eliminated. Nothing where too little of
/// the target is seen.
std::optional<CellCovariance> Information(const CellRun& run, const Candidate& candidate,
                                          const std::array<double, 2>& weights) {
  State state = run.state;
  state.blocks = {PoseBlock{candidate.T_camera_target, {}}};
  Station station;
  for (const std::size_t device : {kCamera, kProjector}) {
    AddVisible(state, weights, device, station);
    const auto num = static_cast<double>(station.seen[device].size());
    if (num < kMinVisibleRatio * static_cast<double>(state.points_target.size())) {
      return std::nullopt;
    }
  }
  Options options = run.options;
  options.free_points = false;
  const CellProblem problem({station}, state.points_target, {{}});
  const Reduced reduced = problem.Reduce(state, options, 0.0);
  return CellCovariance(reduced.hessian);
}

/// (C^-1 + S)^-1 without inverting C, which has zero rows for what is held.
CellCovariance Updated(const CellCovariance& covariance, const CellCovariance& information) {
  const CellCovariance M = CellCovariance::Identity() + covariance * information;
  const CellCovariance updated = dense::Solve(M, covariance);
  return 0.5 * (updated + updated.transpose());
}

std::string Words(const Candidate& candidate, double z_m, const NextPose& next) {
  constexpr std::array<const char*, 3> kColumns = {"left", "middle", "right"};
  constexpr std::array<const char*, 3> kRows = {"upper", "middle", "lower"};
  const char* column = kColumns[static_cast<std::size_t>(candidate.column + 1)];
  const char* row = kRows[static_cast<std::size_t>(candidate.row + 1)];
  const std::string where = candidate.column == 0 && candidate.row == 0
                                ? "in the middle of the camera image"
                                : fmt::format("in the {} {} of the camera image", row, column);
  std::string how = "facing the camera";
  if (candidate.tilt.x() != 0) {
    how = fmt::format("tilted by 30 deg so that its {} edge comes nearer",
                      candidate.tilt.x() > 0 ? "upper" : "lower");
  } else if (candidate.tilt.y() != 0) {
    how = fmt::format("tilted by 30 deg so that its {} edge comes nearer",
                      candidate.tilt.y() > 0 ? "right" : "left");
  }
  return fmt::format(
      "place the target {} at {:.2f} m, {}: the predicted error falls from {:.4f} to {:.4f} mm",
      where, z_m, how, 1e3 * next.error_before_m, 1e3 * next.error_after_m);
}

}  // namespace

NextPose SuggestNextPose(const CellRun& run, const CellCovariance& covariance,
                         const Coverage& coverage) {
  NextPose next;
  const std::vector<Eigen::Vector3d> points = UsedPoints(run);
  DepthRange range{std::numeric_limits<double>::infinity(), 0.0};
  for (const Eigen::Vector3d& p : points) {
    range.near_m = std::min(range.near_m, p.z());
    range.far_m = std::max(range.far_m, p.z());
  }
  // Where depth was hardly varied, that is what helps: look beyond the range so far.
  if (coverage.depth_ratio < run.config.min_depth_ratio) {
    range.near_m *= 1.0 - run.config.min_depth_ratio;
    range.far_m *= 1.0 + run.config.min_depth_ratio;
  }
  const std::vector<PointJacobian> jacobians = FieldJacobians(run, points);
  next.error_before_m = MeanError(jacobians, covariance);
  next.error_after_m = next.error_before_m;
  const std::array<double, 2> weights = {TypicalWeight(run, kCamera),
                                         TypicalWeight(run, kProjector)};
  for (const Candidate& candidate : Candidates(run, range)) {
    const auto information = Information(run, candidate, weights);
    if (!information) continue;
    const double error = MeanError(jacobians, Updated(covariance, *information));
    if (!(error < next.error_after_m)) continue;
    next.error_after_m = error;
    next.T_camera_target = candidate.T_camera_target;
    const double z =
        0.5 * ((1 - candidate.depth) * range.near_m + (1 + candidate.depth) * range.far_m);
    next.words = Words(candidate, z, next);
  }
  if (next.words.empty()) next.words = "no pose of the target is seen well by both devices";
  return next;
}

}  // namespace fringe_fusion::bundle
