#include "cell_problem.hpp"

#include <cmath>
#include <limits>
#include <utility>

#include "common/constants.hpp"
#include "common/dense.hpp"
#include "device_rows.hpp"
#include "dot_image.hpp"
#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::bundle {
namespace {

constexpr int kPose = kNumCellParameters;       // first column of the pose
constexpr int kPoint = kNumCellParameters + 6;  // first column of the point
constexpr double kMaxDamping = 1e12;

using Matrix3 = Eigen::Matrix3d;
using Matrix39 = Eigen::Matrix<double, 3, 9>;  // by pose and point

/// Huber: cost and weight of a squared norm.
struct Robust {
  double cost = 0.0;
  double weight = 1.0;
};
Robust Huber(double squared, double limit) {
  if (squared <= limit * limit) return {squared, 1.0};
  const double norm = std::sqrt(squared);
  return {2.0 * limit * norm - limit * limit, limit / norm};
}

/// A point in the camera's frame and how pose and point move it.
struct PlacedPoint {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Matrix39 jacobian = Matrix39::Zero();
};

Eigen::Vector3d TargetPoint(const State& state, const Station& station, int point) {
  Eigen::Vector3d point_target = state.points_target[static_cast<std::size_t>(point)];
  if (station.shift < 0) return point_target;
  return point_target +
         state.blocks[station.block].shifts_m[static_cast<std::size_t>(station.shift)];
}

PlacedPoint Place(const State& state, const Station& station, int point) {
  const PoseBlock& block = state.blocks[station.block];
  const Eigen::Vector3d point_target = TargetPoint(state, station, point);
  const Matrix3 R = block.T_camera_target.linear();
  PlacedPoint placed;
  placed.point = block.T_camera_target * point_target;
  // T Exp(xi): the point moves by omega x p + rho before T.
  placed.jacobian << -R * Hat(point_target), R, R;
  return placed;
}

/// The centre of the ellipse that a dot of this radius is imaged to lies on the ray of
/// X - rho^2 / Z (e3 - n n_z): H Q^-1 H^T e3 with H = (r1 r2 X), science 1.2.
Eigen::Vector3d EllipseCentre(const Eigen::Vector3d& dot, const Eigen::Vector3d& n,
                              double radius_m) {
  return dot - radius_m * radius_m / dot.z() * (Eigen::Vector3d::UnitZ() - n * n.z());
}

PlacedPoint EllipseCentre(const PlacedPoint& dot, const Matrix3& R, double radius_m) {
  const Eigen::Vector3d n = R.col(2);
  const double z = dot.point.z();
  const double share = radius_m * radius_m / z;
  const Eigen::Vector3d offset = Eigen::Vector3d::UnitZ() - n * n.z();
  PlacedPoint centre;
  centre.point = EllipseCentre(dot.point, n, radius_m);
  Matrix3 by_point = Matrix3::Identity();
  by_point.col(2) += share / z * offset;
  Matrix3 by_normal = share * n.z() * Matrix3::Identity();
  by_normal.col(2) += share * n;
  centre.jacobian = by_point * dot.jacobian;
  centre.jacobian.leftCols<3>() -= by_normal * R * Hat(Eigen::Vector3d::UnitZ());
  return centre;
}

Eigen::Index NumShared(const State& state, const Options& options) {
  return kNumCellParameters +
         (options.free_points ? 3 * static_cast<Eigen::Index>(state.points_target.size()) : 0);
}

void AddPointTerms(const LocalJacobian& jacobian, const Eigen::Vector2d& e, double weight,
                   int point, StationSums& sums) {
  const Eigen::Index at = 3 * static_cast<Eigen::Index>(point);
  const Eigen::Matrix<double, 2, 3> by_point = weight * jacobian.rightCols<3>();
  sums.cross.middleCols<3>(at) += jacobian.transpose() * by_point;
  sums.point_hessian.middleCols<3>(at) += jacobian.rightCols<3>().transpose() * by_point;
  sums.point_gradient.segment<3>(at) += by_point.transpose() * e;
}

void AddPrior(const State& state, const Options& options,
              const std::vector<Eigen::Vector3d>& nominal, Reduced& reduced) {
  if (!options.free_points) return;
  const double weight = 1.0 / (options.sigma_point_m * options.sigma_point_m);
  for (std::size_t j = 0; j < nominal.size(); ++j) {
    const Eigen::Index at = kNumCellParameters + 3 * static_cast<Eigen::Index>(j);
    reduced.hessian.diagonal().segment<3>(at).array() += weight;
    reduced.gradient.segment<3>(at) += weight * (state.points_target[j] - nominal[j]);
  }
}

/// Normal equations of one pose with its stage shifts, before they are eliminated.
struct BlockSums {
  Eigen::MatrixXd shared;
  Eigen::VectorXd shared_gradient;
  Eigen::MatrixXd own;
  Eigen::MatrixXd coupling;
  Eigen::VectorXd gradient;

  BlockSums(const PoseBlock& block, Eigen::Index num_shared) {
    const Eigen::Index size = 6 + 3 * static_cast<Eigen::Index>(block.shifts_m.size());
    shared = Eigen::MatrixXd::Zero(num_shared, num_shared);
    shared_gradient = Eigen::VectorXd::Zero(num_shared);
    own = Eigen::MatrixXd::Zero(size, size);
    coupling = Eigen::MatrixXd::Zero(size, num_shared);
    gradient = Eigen::VectorXd::Zero(size);
  }

  void Add(const Station& station, const StationSums& s) {
    shared.topLeftCorner<kPose, kPose>() += s.hessian.topLeftCorner<kPose, kPose>();
    shared_gradient.head<kPose>() += s.gradient.head<kPose>();
    own.topLeftCorner<6, 6>() += s.hessian.block<6, 6>(kPose, kPose);
    coupling.topLeftCorner<6, kPose>() += s.hessian.block<6, kPose>(kPose, 0);
    gradient.head<6>() += s.gradient.segment<6>(kPose);
    const Eigen::Index at = 6 + 3 * station.shift;
    if (station.shift >= 0) {
      own.block<3, 3>(at, at) += s.hessian.block<3, 3>(kPoint, kPoint);
      own.block<3, 6>(at, 0) += s.hessian.block<3, 6>(kPoint, kPose);
      own.block<6, 3>(0, at) += s.hessian.block<6, 3>(kPose, kPoint);
      coupling.block<3, kPose>(at, 0) += s.hessian.block<3, kPose>(kPoint, 0);
      gradient.segment<3>(at) += s.gradient.segment<3>(kPoint);
    }
    const Eigen::Index num_points = s.cross.cols();
    if (num_points == 0) return;
    coupling.topRightCorner(6, num_points) += s.cross.middleRows<6>(kPose);
    if (station.shift >= 0) coupling.block(at, kPose, 3, num_points) += s.cross.bottomRows<3>();
    shared.topRightCorner(kPose, num_points) += s.cross.topRows<kPose>();
    shared_gradient.tail(num_points) += s.point_gradient;
    for (Eigen::Index j = 0; j < num_points; j += 3) {
      shared.block<3, 3>(kPose + j, kPose + j) += s.point_hessian.middleCols<3>(j);
    }
  }

  void AddShiftPrior(const PoseBlock& block, const std::vector<Eigen::Vector3d>& nominal,
                     const Options& options) {
    const double weight = 1.0 / (options.sigma_shift_m * options.sigma_shift_m);
    for (std::size_t k = 0; k < block.shifts_m.size(); ++k) {
      const Eigen::Index at = 6 + 3 * static_cast<Eigen::Index>(k);
      own.diagonal().segment<3>(at).array() += weight;
      gradient.segment<3>(at) += weight * (block.shifts_m[k] - nominal[k]);
    }
  }
};

void Damp(Eigen::MatrixXd& hessian, double damping) {
  if (damping > 0.0) hessian.diagonal() *= 1.0 + damping;
}

}  // namespace

void DeviceSums::Add(const DeviceSums& other) {
  chi2 += other.chi2;
  sum_px2 += other.sum_px2;
  count += other.count;
}

Eigen::Matrix<double, 2, kNumModel> PixelByModel(const CameraModel& model,
                                                 const Eigen::Vector2d& normalized) {
  const double x = normalized.x();
  const double y = normalized.y();
  const double r2 = normalized.squaredNorm();
  const Eigen::Vector2d distorted = Distort(model, normalized);
  Eigen::Matrix<double, 2, kNumModel> J;
  J.row(0) << distorted.x(), 0.0, 1.0, 0.0, x * r2, x * r2 * r2, 2.0 * x * y, r2 + 2.0 * x * x,
      x * r2 * r2 * r2;
  J.row(1) << 0.0, distorted.y(), 0.0, 1.0, y * r2, y * r2 * r2, r2 + 2.0 * y * y, 2.0 * x * y,
      y * r2 * r2 * r2;
  J.row(0).tail<5>() *= model.fx;
  J.row(1).tail<5>() *= model.fy;
  return J;
}

CellProblem::CellProblem(std::vector<Station> stations, std::vector<Eigen::Vector3d> nominal_points,
                         std::vector<std::vector<Eigen::Vector3d>> nominal_shifts)
    : stations_(std::move(stations)),
      nominal_points_(std::move(nominal_points)),
      nominal_shifts_(std::move(nominal_shifts)) {}

Linearized CellProblem::Linearize(const State& state, const Station& station,
                                  const Observation& seen, std::size_t device,
                                  const Options& options) {
  PlacedPoint placed = Place(state, station, seen.point);
  Linearized out;
  Eigen::Matrix<double, 2, kNumLocal>& J = out.jacobian;
  const CameraModel& model = state.devices[device];
  if (device == kProjector) {
    const Matrix3 R = state.T_projector_camera.linear();
    const Matrix3 by_rotation = -R * Hat(placed.point);
    placed.point = state.T_projector_camera * placed.point;
    placed.jacobian = R * placed.jacobian;
    const Projection projection = ProjectWithJacobian(model, placed.point);
    out.residual_px = projection.pixel - seen.pixel;
    J.middleCols<3>(2 * kNumModel) = projection.jacobian * by_rotation;
    J.middleCols<3>(2 * kNumModel + 3) = projection.jacobian * R;
    J.rightCols<9>() = projection.jacobian * placed.jacobian;
    J.middleCols<kNumModel>(kNumModel) =
        PixelByModel(model, placed.point.head<2>() / placed.point.z());
  } else {
    if (seen.dot_radius_m > 0.0) {
      const Matrix3 R = state.blocks[station.block].T_camera_target.linear();
      // Hundredths of a pixel, whose change from step to step does not matter.
      out.residual_px = LensShiftOfDot(model, placed.point, R, seen.dot_radius_m);
      placed = EllipseCentre(placed, R, seen.dot_radius_m);
    }
    const Projection projection = ProjectWithJacobian(model, placed.point);
    out.residual_px += projection.pixel - seen.pixel;
    J.rightCols<9>() = projection.jacobian * placed.jacobian;
    J.leftCols<kNumModel>() = PixelByModel(model, placed.point.head<2>() / placed.point.z());
  }
  const Eigen::Matrix2d whitener = seen.whitener / options.scale[device];
  out.e = whitener * out.residual_px;
  J = whitener * J;
  return out;
}

Residual CellProblem::Miss(const State& state, const Station& station, const Observation& seen,
                           std::size_t device, const Options& options) {
  const Transform& T_camera_target = state.blocks[station.block].T_camera_target;
  Eigen::Vector3d point = T_camera_target * TargetPoint(state, station, seen.point);
  const CameraModel& model = state.devices[device];
  Residual out;
  if (device == kProjector) {
    point = state.T_projector_camera * point;
  } else if (seen.dot_radius_m > 0.0) {
    const Matrix3 R = T_camera_target.linear();
    out.residual_px = LensShiftOfDot(model, point, R, seen.dot_radius_m);
    point = EllipseCentre(point, R.col(2), seen.dot_radius_m);
  }
  out.residual_px += Project(model, point) - seen.pixel;
  out.e = seen.whitener * out.residual_px / options.scale[device];
  return out;
}

StationSums CellProblem::Sum(const State& state, const Options& options,
                             std::size_t station_index) const {
  const Station& station = stations_[station_index];
  StationSums sums;
  if (options.free_points) {
    const auto size = 3 * static_cast<Eigen::Index>(nominal_points_.size());
    sums.cross = Eigen::MatrixXd::Zero(kNumLocal, size);
    sums.point_hessian = Eigen::MatrixXd::Zero(3, size);
    sums.point_gradient = Eigen::VectorXd::Zero(size);
  }
  for (const std::size_t device : {kCamera, kProjector}) {
    DeviceRows rows(station.seen[device].size());
    for (std::size_t k = 0; k < station.seen[device].size(); ++k) {
      const Observation& seen = station.seen[device][k];
      const Linearized at = Linearize(state, station, seen, device, options);
      const double squared = at.e.squaredNorm();
      if (!std::isfinite(squared)) {
        sums.cost = kInfinity;
        return sums;
      }
      const Robust robust = Huber(squared, options.huber_sigma);
      sums.cost += robust.cost;
      sums.devices[device].Add({robust.weight * squared, at.residual_px.squaredNorm(), 1});
      rows.Set(k, at, robust.weight);
      if (options.free_points) AddPointTerms(at.jacobian, at.e, robust.weight, seen.point, sums);
    }
    rows.AddTo(device, sums);
  }
  return sums;
}

std::vector<StationSums> CellProblem::SumAll(const State& state, const Options& options) const {
  std::vector<StationSums> sums(stations_.size());
  ParallelFor(static_cast<int>(stations_.size()), 1, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      sums[static_cast<std::size_t>(i)] = Sum(state, options, static_cast<std::size_t>(i));
    }
  });
  return sums;
}

std::array<DeviceSums, 2> CellProblem::Sums(const State& state, const Options& options) const {
  std::array<DeviceSums, 2> total;
  for (const Station& station : stations_) {
    for (const std::size_t device : {kCamera, kProjector}) {
      for (const Observation& seen : station.seen[device]) {
        const Residual at = Miss(state, station, seen, device, options);
        const double squared = at.e.squaredNorm();
        total[device].Add({Huber(squared, options.huber_sigma).weight * squared,
                           at.residual_px.squaredNorm(), 1});
      }
    }
  }
  return total;
}

double CellProblem::PriorCost(const State& state, const Options& options) const {
  double cost = 0.0;
  if (options.free_points) {
    for (std::size_t j = 0; j < nominal_points_.size(); ++j) {
      cost += (state.points_target[j] - nominal_points_[j]).squaredNorm() /
              (options.sigma_point_m * options.sigma_point_m);
    }
  }
  for (std::size_t b = 0; b < state.blocks.size(); ++b) {
    for (std::size_t k = 0; k < state.blocks[b].shifts_m.size(); ++k) {
      cost += (state.blocks[b].shifts_m[k] - nominal_shifts_[b][k]).squaredNorm() /
              (options.sigma_shift_m * options.sigma_shift_m);
    }
  }
  return cost;
}

double CellProblem::Cost(const State& state, const Options& options) const {
  std::vector<double> costs(stations_.size(), 0.0);
  ParallelFor(static_cast<int>(stations_.size()), 4, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      const Station& station = stations_[static_cast<std::size_t>(i)];
      for (const std::size_t device : {kCamera, kProjector}) {
        for (const Observation& seen : station.seen[device]) {
          const double squared = Miss(state, station, seen, device, options).e.squaredNorm();
          costs[static_cast<std::size_t>(i)] +=
              std::isfinite(squared) ? Huber(squared, options.huber_sigma).cost : kInfinity;
        }
      }
    }
  });
  double cost = PriorCost(state, options);
  for (const double value : costs) cost += value;
  return cost;
}

Reduced CellProblem::Eliminate(const State& state, const Options& options,
                               const std::vector<StationSums>& sums, double damping) const {
  const Eigen::Index num_shared = NumShared(state, options);
  Reduced reduced;
  reduced.hessian = Eigen::MatrixXd::Zero(num_shared, num_shared);
  reduced.gradient = Eigen::VectorXd::Zero(num_shared);
  for (std::size_t b = 0; b < state.blocks.size(); ++b) {
    BlockSums block(state.blocks[b], num_shared);
    for (std::size_t i = 0; i < stations_.size(); ++i) {
      if (stations_[i].block == b) block.Add(stations_[i], sums[i]);
    }
    // A pose that was left out has no observations.
    if (block.own.trace() == 0.0) block.own.setIdentity();
    block.AddShiftPrior(state.blocks[b], nominal_shifts_[b], options);
    Damp(block.own, damping);
    const Eigen::MatrixXd inverse = dense::SolveSymmetric(
        block.own, Eigen::MatrixXd::Identity(block.own.rows(), block.own.rows()));
    block.shared -= block.coupling.transpose() * (inverse * block.coupling);
    block.shared_gradient -= block.coupling.transpose() * (inverse * block.gradient);
    reduced.hessian += block.shared;
    reduced.gradient += block.shared_gradient;
    reduced.block_inverse.push_back(inverse);
    reduced.block_coupling.push_back(std::move(block.coupling));
    reduced.block_gradient.push_back(std::move(block.gradient));
    reduced.share_hessian.push_back(std::move(block.shared));
    reduced.share_gradient.push_back(std::move(block.shared_gradient));
  }
  AddPrior(state, options, nominal_points_, reduced);
  reduced.hessian.triangularView<Eigen::StrictlyLower>() = reduced.hessian.transpose();
  // The diagonal of the reduced system stands for that of the whole one: same order of size.
  Damp(reduced.hessian, damping);
  return reduced;
}

Reduced CellProblem::Reduce(const State& state, const Options& options, double damping) const {
  return Eliminate(state, options, SumAll(state, options), damping);
}

std::vector<Eigen::Index> FreeIndices(const Options& options, Eigen::Index size) {
  std::vector<Eigen::Index> free;
  for (Eigen::Index i = 0; i < size; ++i) {
    if (i >= kNumCellParameters || options.free[static_cast<std::size_t>(i)]) free.push_back(i);
  }
  return free;
}

std::optional<Eigen::VectorXd> SolveFree(const Eigen::MatrixXd& hessian,
                                         const Eigen::VectorXd& gradient,
                                         const std::vector<Eigen::Index>& free) {
  Eigen::VectorXd step = Eigen::VectorXd::Zero(gradient.size());
  if (free.empty()) return step;
  Eigen::MatrixXd part = hessian(free, free);
  // Focal lengths and distortion terms differ by many orders of magnitude.
  const Eigen::VectorXd scale = part.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  part = scale.asDiagonal() * part * scale.asDiagonal();
  const Eigen::VectorXd right = scale.cwiseProduct(Eigen::VectorXd(gradient(free)));
  const auto scaled_step = dense::SolvePositive(part, right);
  if (!scaled_step) return std::nullopt;
  const Eigen::VectorXd solved = -scale.cwiseProduct(*scaled_step);
  if (!solved.allFinite()) return std::nullopt;
  for (std::size_t i = 0; i < free.size(); ++i) {
    step[free[i]] = solved[static_cast<Eigen::Index>(i)];
  }
  return step;
}

void MoveShared(State& state, const Eigen::Ref<const Eigen::VectorXd>& step) {
  for (std::size_t device = 0; device < 2; ++device) {
    CameraModel& model = state.devices[device];
    const Eigen::Index at = kNumModel * static_cast<Eigen::Index>(device);
    model.fx += step[at];
    model.fy += step[at + 1];
    model.cx += step[at + 2];
    model.cy += step[at + 3];
    for (std::size_t k = 0; k < model.distortion.size(); ++k) {
      model.distortion[k] += step[at + 4 + static_cast<Eigen::Index>(k)];
    }
  }
  const Vector6d xi = step.segment<6>(2 * kNumModel);
  state.T_projector_camera = state.T_projector_camera * Exp(xi);
}

State CellProblem::Moved(const State& state, const Options& options, const Reduced& reduced,
                         const Eigen::VectorXd& step) const {
  State moved = state;
  MoveShared(moved, step.head<kNumCellParameters>());
  if (options.free_points) {
    for (std::size_t j = 0; j < moved.points_target.size(); ++j) {
      moved.points_target[j] +=
          step.segment<3>(kNumCellParameters + 3 * static_cast<Eigen::Index>(j));
    }
  }
  for (std::size_t b = 0; b < moved.blocks.size(); ++b) {
    const Eigen::VectorXd own =
        -reduced.block_inverse[b] * (reduced.block_gradient[b] + reduced.block_coupling[b] * step);
    const Vector6d xi = own.head<6>();
    moved.blocks[b].T_camera_target = moved.blocks[b].T_camera_target * Exp(xi);
    for (std::size_t k = 0; k < moved.blocks[b].shifts_m.size(); ++k) {
      moved.blocks[b].shifts_m[k] += own.segment<3>(6 + 3 * static_cast<Eigen::Index>(k));
    }
  }
  return moved;
}

bool CellProblem::Solve(State& state, const Options& options, int max_iterations) const {
  double cost = Cost(state, options);
  if (!std::isfinite(cost)) return false;
  double damping = 1e-4;
  const std::vector<Eigen::Index> free = FreeIndices(options, NumShared(state, options));
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const std::vector<StationSums> sums = SumAll(state, options);
    bool improved = false;
    double decrease = 0.0;
    while (!improved && damping < kMaxDamping) {
      const Reduced reduced = Eliminate(state, options, sums, damping);
      const auto step = SolveFree(reduced.hessian, reduced.gradient, free);
      if (step) {
        State moved = Moved(state, options, reduced, *step);
        const double moved_cost = Cost(moved, options);
        if (moved_cost <= cost) {
          decrease = cost - moved_cost;
          state = std::move(moved);
          cost = moved_cost;
          improved = true;
          damping = std::max(damping * 0.1, 1e-10);
          continue;
        }
      }
      damping *= 10.0;
    }
    // The last decrease says how far the optimum may still be: in units of one deviation squared.
    constexpr double kConverged = 1e-7;
    if (!improved || (decrease < kConverged + 1e-12 * cost && damping < 1e-2)) return true;
  }
  return true;
}

void CellProblem::FitPose(State& state, const Options& options, std::size_t station,
                          int iterations) const {
  Transform& T = state.blocks[stations_[station].block].T_camera_target;
  Options own = options;
  own.free_points = false;
  for (int i = 0; i < iterations; ++i) {
    const StationSums sums = Sum(state, own, station);
    if (!std::isfinite(sums.cost)) return;
    const Matrix6d hessian = sums.hessian.block<6, 6>(kPose, kPose);
    const Vector6d step = -dense::SolveSymmetric(hessian, sums.gradient.segment<6>(kPose));
    if (!step.allFinite()) return;
    T = T * Exp(step);
  }
}

}  // namespace fringe_fusion::bundle
