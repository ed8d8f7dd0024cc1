#include "bundle.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "common/constants.hpp"
#include "common/dense.hpp"
#include "epipolar_solver.hpp"
#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::epipolar {
namespace {

constexpr int kTracksPerChunk = 1024;

using Matrix24d = Eigen::Matrix<double, 2, 4>;
using Matrix26d = Eigen::Matrix<double, 2, 6>;
using Matrix28d = Eigen::Matrix<double, 2, 8>;

/// Derivative of a pixel by (log f, cx, cy, k1) at fixed normalised coordinates.
Matrix24d PixelByIntrinsics(const CameraModel& model, const Eigen::Vector2d& normalized,
                            const Eigen::Vector2d& pixel) {
  Matrix24d J;
  J.col(0) = pixel - Eigen::Vector2d(model.cx, model.cy);
  J.col(1) = Eigen::Vector2d::UnitX();
  J.col(2) = Eigen::Vector2d::UnitY();
  J.col(3) = normalized.squaredNorm() *
             Eigen::Vector2d(model.fx * normalized.x(), model.fy * normalized.y());
  return J;
}

CameraModel MovedModel(CameraModel model, const Eigen::Vector4d& step) {
  model.fx *= std::exp(step[0]);
  model.fy *= std::exp(step[0]);
  model.cx += step[1];
  model.cy += step[2];
  model.distortion[0] += step[3];
  return model;
}

Eigen::Vector4d DifferenceOf(const CameraModel& model, const CameraModel& nominal) {
  return {std::log(model.fx / nominal.fx), model.cx - nominal.cx, model.cy - nominal.cy,
          model.distortion[0] - nominal.distortion[0]};
}

Vector8d SigmasOf(const IntrinsicsPrior& anchor, const IntrinsicsPrior& moving) {
  Vector8d sigma;
  sigma << anchor.focal_ratio, anchor.principal_px, anchor.principal_px, anchor.k1,
      moving.focal_ratio, moving.principal_px, moving.principal_px, moving.k1;
  return sigma;
}

}  // namespace

/// One linearised sighting: whitened residual with its derivatives.
struct Sighting {
  int station = 0;
  Eigen::Vector2d residual_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d e = Eigen::Vector2d::Zero();
  double weight = 1.0;
  Matrix26d by_pose = Matrix26d::Zero();
  Matrix28d by_intrinsics = Matrix28d::Zero();
  Eigen::Vector2d by_depth = Eigen::Vector2d::Zero();  ///< of the logarithm of the depth
};

/// A track's point in the anchor's frame.
struct AnchorPoint {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Matrix24d ray_by_intrinsics = Matrix24d::Zero();
};

struct Bundle::TrackSums {
  std::vector<Sighting> sightings;
  double hessian = 0.0;   ///< of the depth
  double gradient = 0.0;  ///< of the depth
  double cost = 0.0;
  double chi2 = 0.0;
  double sum_px2 = 0.0;
  int num_inliers = 0;

  void Clear() {
    sightings.clear();
    hessian = gradient = cost = chi2 = sum_px2 = 0.0;
    num_inliers = 0;
  }
};

Bundle::Bundle(const TrackSet& tracks, const IntrinsicsPrior& anchor, const IntrinsicsPrior& moving,
               const DevicePair& nominal, double huber_sigma)
    : tracks_(tracks),
      nominal_(nominal),
      prior_sigma_(SigmasOf(anchor, moving)),
      huber_sigma_(huber_sigma),
      first_(tracks.anchor_px.size() + 1, 0) {
  for (const TrackObservation& seen : tracks.observations) {
    ++first_[static_cast<std::size_t>(seen.track) + 1];
  }
  for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
}

Sighting Bundle::Linearize(const BundleState& state, const AnchorPoint& at,
                           const TrackObservation& seen) const {
  const Transform& T = state.T_station_anchor[static_cast<std::size_t>(seen.station)];
  const Eigen::Vector3d point_station = T * at.point;
  const Projection projection = ProjectWithJacobian(state.devices.observed, point_station);
  // Whitening: Sigma = L L^T.
  const Eigen::Matrix2d whitener =
      Eigen::Matrix2d(seen.covariance_px2.llt().matrixL()).inverse() / scale_;
  Sighting out;
  out.station = seen.station;
  out.residual_px = projection.pixel - seen.pixel;
  out.e = whitener * out.residual_px;
  const Eigen::Matrix<double, 2, 3> by_point = whitener * projection.jacobian * T.linear();
  // T Exp(xi): the point in the anchor's frame moves by omega x p + rho.
  out.by_pose << -by_point * Hat(at.point), by_point;
  out.by_depth = by_point * at.point;
  out.by_intrinsics.leftCols<4>() = at.point.z() * by_point.leftCols<2>() * at.ray_by_intrinsics;
  const Eigen::Vector2d normalized = point_station.head<2>() / point_station.z();
  out.by_intrinsics.rightCols<4>() =
      whitener * PixelByIntrinsics(state.devices.observed, normalized, projection.pixel);
  const double magnitude = out.e.norm();
  out.weight = magnitude <= huber_sigma_    ? 1.0
               : magnitude <= reject_sigma_ ? huber_sigma_ / magnitude
                                            : 0.0;
  return out;
}

bool Bundle::SumTrack(const BundleState& state, std::size_t track, TrackSums& sums) const {
  sums.Clear();
  const double depth = state.depth_m[track];
  if (!(depth > 0.0) || first_[track] == first_[track + 1]) return false;
  const Eigen::Vector2d& anchor_px = tracks_.anchor_px[track];
  const Eigen::Vector2d ray = Undistort(state.devices.anchor, anchor_px);
  if (!ray.allFinite()) return false;
  // The anchor's pixel is fixed: its intrinsics move the ray.
  const AnchorPoint at{depth * ray.homogeneous(),
                       -UndistortJacobian(state.devices.anchor, ray) *
                           PixelByIntrinsics(state.devices.anchor, ray, anchor_px)};
  for (std::size_t k = first_[track]; k < first_[track + 1]; ++k) {
    const Sighting s = Linearize(state, at, tracks_.observations[k]);
    const double magnitude = s.e.norm();
    // A point behind the device has no pixel: NaN.
    if (!std::isfinite(magnitude)) return false;
    const double counted = std::min(magnitude, reject_sigma_);
    sums.cost += s.weight < 1.0 ? 2.0 * huber_sigma_ * counted - huber_sigma_ * huber_sigma_
                                : magnitude * magnitude;
    if (s.weight > 0.0) {
      sums.chi2 += magnitude * magnitude;
      sums.sum_px2 += s.residual_px.squaredNorm();
      ++sums.num_inliers;
    }
    sums.hessian += s.weight * s.by_depth.squaredNorm();
    sums.gradient += s.weight * s.by_depth.dot(s.e);
    sums.sightings.push_back(s);
  }
  return std::isfinite(sums.cost);
}

void ReducedSystem::Resize(Eigen::Index size) {
  hessian = Eigen::MatrixXd::Zero(size, size);
  gradient = Eigen::VectorXd::Zero(size);
}

void ReducedSystem::Add(const ReducedSystem& other) {
  hessian += other.hessian;
  gradient += other.gradient;
  cost += other.cost;
  chi2 += other.chi2;
  sum_px2 += other.sum_px2;
  num_inliers += other.num_inliers;
  num_tracks += other.num_tracks;
}

void Bundle::AddTrack(const TrackSums& sums, double damping, ReducedSystem& system) {
  system.chi2 += sums.chi2;
  system.sum_px2 += sums.sum_px2;
  system.num_inliers += sums.num_inliers;
  ++system.num_tracks;
  Vector8d cross_intrinsics = Vector8d::Zero();
  std::vector<Vector6d> cross;
  cross.reserve(sums.sightings.size());
  for (const Sighting& s : sums.sightings) {
    const Eigen::Index at = 8 + 6 * s.station;
    const Matrix28d weighted = s.weight * s.by_intrinsics;
    system.hessian.topLeftCorner<8, 8>() += weighted.transpose() * s.by_intrinsics;
    system.hessian.block<6, 6>(at, at) += s.weight * s.by_pose.transpose() * s.by_pose;
    system.hessian.block<8, 6>(0, at) += weighted.transpose() * s.by_pose;
    system.gradient.head<8>() += weighted.transpose() * s.e;
    system.gradient.segment<6>(at) += s.weight * s.by_pose.transpose() * s.e;
    cross_intrinsics += weighted.transpose() * s.by_depth;
    cross.emplace_back(s.weight * s.by_pose.transpose() * s.by_depth);
  }
  // The scalar Schur complement of the depth, which is damped like every other unknown.
  const double inverse = 1.0 / (sums.hessian * (1.0 + damping));
  system.hessian.topLeftCorner<8, 8>() -= inverse * cross_intrinsics * cross_intrinsics.transpose();
  system.gradient.head<8>() -= inverse * sums.gradient * cross_intrinsics;
  for (std::size_t a = 0; a < cross.size(); ++a) {
    const Eigen::Index row = 8 + 6 * sums.sightings[a].station;
    system.gradient.segment<6>(row) -= inverse * sums.gradient * cross[a];
    system.hessian.block<8, 6>(0, row) -= inverse * cross_intrinsics * cross[a].transpose();
    for (std::size_t b = a; b < cross.size(); ++b) {
      const Eigen::Index column = 8 + 6 * sums.sightings[b].station;
      system.hessian.block<6, 6>(row, column) -= inverse * cross[a] * cross[b].transpose();
    }
  }
}

ReducedSystem Bundle::Reduce(const BundleState& state, double damping) const {
  const auto size = static_cast<Eigen::Index>(8 + 6 * state.T_station_anchor.size());
  const int count = static_cast<int>(state.depth_m.size());
  const auto num_chunks = static_cast<std::size_t>((count + kTracksPerChunk - 1) / kTracksPerChunk);
  std::vector<ReducedSystem> parts(num_chunks);
  ParallelFor(count, kTracksPerChunk, [&](int begin, int end) {
    ReducedSystem& part = parts[static_cast<std::size_t>(begin / kTracksPerChunk)];
    part.Resize(size);
    TrackSums sums;
    for (int i = begin; i < end; ++i) {
      if (!SumTrack(state, static_cast<std::size_t>(i), sums)) continue;
      part.cost += sums.cost;
      if (sums.hessian > 0.0) AddTrack(sums, damping, part);
    }
  });
  ReducedSystem system;
  system.Resize(size);
  for (const ReducedSystem& part : parts) system.Add(part);
  // Only the upper half was filled.
  const Eigen::MatrixXd upper = system.hessian;
  system.hessian.triangularView<Eigen::StrictlyLower>() = upper.transpose();
  AddPriors(state, system);
  return system;
}

void Bundle::AddPriors(const BundleState& state, ReducedSystem& system) const {
  Vector8d difference;
  difference << DifferenceOf(state.devices.anchor, nominal_.anchor),
      DifferenceOf(state.devices.observed, nominal_.observed);
  for (Eigen::Index k = 0; k < 8; ++k) {
    const double sigma = prior_sigma_[k];
    if (!(sigma > 0.0) || !std::isfinite(sigma)) continue;
    const double information = 1.0 / (sigma * sigma);
    system.hessian(k, k) += information;
    system.gradient[k] += information * difference[k];
    system.cost += information * difference[k] * difference[k];
  }
}

Eigen::MatrixXd Bundle::FreeBasis(const BundleState& state) const {
  const auto size = static_cast<Eigen::Index>(8 + 6 * state.T_station_anchor.size());
  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(size, size);
  Eigen::Index column = 0;
  for (Eigen::Index k = 0; k < 8; ++k) {
    if (prior_sigma_[k] > 0.0) basis(k, column++) = 1.0;
  }
  // Station 0 keeps its distance: its translation moves across itself only.
  const Transform& first = state.T_station_anchor.front();
  for (Eigen::Index k = 8; k < 11; ++k) basis(k, column++) = 1.0;
  const Matrix32d across =
      first.linear().transpose() * TangentBasis(first.translation().normalized());
  basis.block<3, 2>(11, column) = across;
  column += 2;
  for (Eigen::Index k = 14; k < size; ++k) basis(k, column++) = 1.0;
  return basis.leftCols(column);
}

double Bundle::Cost(const BundleState& state) const {
  const int count = static_cast<int>(state.depth_m.size());
  std::vector<double> costs(static_cast<std::size_t>(count), 0.0);
  ParallelFor(count, kTracksPerChunk, [&](int begin, int end) {
    TrackSums sums;
    for (int i = begin; i < end; ++i) {
      const auto track = static_cast<std::size_t>(i);
      if (std::isnan(state.depth_m[track]) || first_[track] == first_[track + 1]) continue;
      // A track that a step takes behind a device makes the step a bad one.
      costs[track] = SumTrack(state, track, sums) ? sums.cost : kInfinity;
    }
  });
  ReducedSystem priors;
  priors.Resize(8);
  AddPriors(state, priors);
  double cost = priors.cost;
  for (const double value : costs) cost += value;
  return cost;
}

BundleState Bundle::Moved(const BundleState& state, const Eigen::VectorXd& step,
                          double damping) const {
  BundleState moved = state;
  moved.devices.anchor = MovedModel(state.devices.anchor, step.segment<4>(0));
  moved.devices.observed = MovedModel(state.devices.observed, step.segment<4>(4));
  for (std::size_t i = 0; i < state.T_station_anchor.size(); ++i) {
    const Vector6d xi = step.segment<6>(static_cast<Eigen::Index>(8 + 6 * i));
    moved.T_station_anchor[i] = state.T_station_anchor[i] * Exp(xi);
  }
  // The gauge to the last digit.
  const double length = state.T_station_anchor.front().translation().norm();
  Transform& first = moved.T_station_anchor.front();
  first.translation() *= length / first.translation().norm();
  const Vector8d intrinsics = step.head<8>();
  ParallelFor(static_cast<int>(state.depth_m.size()), kTracksPerChunk, [&](int begin, int end) {
    TrackSums sums;
    for (int i = begin; i < end; ++i) {
      const auto track = static_cast<std::size_t>(i);
      if (!SumTrack(state, track, sums) || !(sums.hessian > 0.0)) continue;
      double right = sums.gradient;
      for (const Sighting& s : sums.sightings) {
        const Eigen::Vector2d change =
            s.by_intrinsics * intrinsics + s.by_pose * step.segment<6>(8 + 6 * s.station);
        right += s.weight * s.by_depth.dot(change);
      }
      moved.depth_m[track] =
          state.depth_m[track] * std::exp(-right / (sums.hessian * (1.0 + damping)));
    }
  });
  return moved;
}

double Bundle::RobustScale(const BundleState& state) const {
  std::vector<double> values;
  TrackSums sums;
  for (std::size_t track = 0; track < state.depth_m.size(); ++track) {
    if (!SumTrack(state, track, sums)) continue;
    for (const Sighting& s : sums.sightings) values.push_back(s.e.squaredNorm());
  }
  if (values.empty()) return 1.0;
  // chi2 with two components, one unknown per track: between 1 and 2 degrees of freedom. The
  // median of chi2 with d dof is about d (1 - 2 / (9 d))^3.
  const double dof =
      2.0 - static_cast<double>(state.depth_m.size()) / static_cast<double>(values.size());
  const double d = std::clamp(dof, 1.0, 2.0);
  const double expected = d * std::pow(1.0 - 2.0 / (9.0 * d), 3);
  return std::max(1.0, scale_ * std::sqrt(MedianInPlace(values) / expected));
}

int Bundle::Solve(BundleState& state, int max_iterations) const {
  double damping = 1e-4;
  double cost = Cost(state);
  for (int iteration = 1; iteration <= max_iterations; ++iteration) {
    const Eigen::MatrixXd basis = FreeBasis(state);
    const ReducedSystem system = Reduce(state, damping);
    const Eigen::MatrixXd hessian = dense::Propagate(basis.transpose(), system.hessian);
    const Eigen::VectorXd gradient = dense::Product(basis.transpose(), system.gradient);
    Eigen::MatrixXd damped = hessian;
    damped.diagonal() *= 1.0 + damping;
    const Eigen::VectorXd free_step = -dense::SolveSymmetric(damped, gradient);
    if (!free_step.allFinite()) return -1;
    const BundleState moved = Moved(state, dense::Product(basis, free_step), damping);
    const double moved_cost = Cost(moved);
    if (moved_cost <= cost) {
      const double size = std::sqrt(std::max(0.0, free_step.dot(hessian * free_step)));
      const bool settled = size < 1e-3 || cost - moved_cost < 1e-9 * cost;
      state = moved;
      cost = moved_cost;
      damping = std::max(1e-10, 0.1 * damping);
      if (settled) return iteration;
    } else {
      damping *= 10.0;
      if (damping > 1e8) return iteration;
    }
  }
  return max_iterations;
}

}  // namespace fringe_fusion::epipolar
