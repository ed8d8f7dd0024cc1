#include "fringe_fusion/registration/pose_system.hpp"

#include <algorithm>
#include <cmath>

#include "common/dense.hpp"

namespace fringe_fusion {
namespace {

// Smallest share of the strongest eigenvalue that is more than rounding.
constexpr double kMinRelativeEigenvalue = 1e-7;
// Smallest share of a direction's information that must not come from noise of the normals.
constexpr double kMinTrueInformation = 0.5;
constexpr double kMinPriorSigma = 1e-8;

// Middle and radius of the overlap, for a well scaled system.
struct Extent {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
};

Extent MeasureOverlap(const std::vector<MatchGeometry>& geometry) {
  Extent extent;
  for (const MatchGeometry& match : geometry) extent.center += match.middle;
  extent.center /= static_cast<double>(geometry.size());
  double sum = 0.0;
  for (const MatchGeometry& match : geometry) {
    sum += (match.middle - extent.center).squaredNorm();
  }
  extent.radius_m = std::sqrt(sum / static_cast<double>(geometry.size()));
  return extent;
}

// Row of the Jacobian of n.(p_first - p_second) for a scaled twist of the first view.
Vector6d Row(const Eigen::Vector3d& arm, const Eigen::Vector3d& normal, double radius_m) {
  Vector6d row;
  row.head<3>() = arm.cross(normal) / radius_m;
  row.tail<3>() = normal;
  return row;
}

// Keeps the directions in which `noise` takes less than half of the Hessian.
void DropEmptyDirections(PairInformation& pair, const Matrix6d& noise) {
  const dense::SymmetricEigen eigen = dense::DecomposeSymmetric(pair.hessian);
  const Vector6d values = eigen.values;
  const Matrix6d axes = eigen.vectors;
  Vector6d root = Vector6d::Zero();
  Vector6d inverse_root = Vector6d::Zero();
  for (int i = 0; i < 6; ++i) {
    if (!(values[i] > kMinRelativeEigenvalue * values[5])) continue;
    root[i] = std::sqrt(values[i]);
    inverse_root[i] = 1.0 / root[i];
  }
  // In the whitened coordinates the Hessian is the identity and the noise has eigenvalues 0..1;
  // directions already dropped have zero columns in both maps and stay out.
  const Matrix6d whiten = axes * inverse_root.asDiagonal();
  const Matrix6d color = axes * root.asDiagonal();
  const Matrix6d white_noise = whiten.transpose() * noise * whiten;
  const dense::SymmetricEigen split = dense::DecomposeSymmetric(white_noise);
  const Matrix6d split_axes = split.vectors;
  Vector6d keep = Vector6d::Zero();
  Vector6d true_share = Vector6d::Zero();
  for (int i = 0; i < 6; ++i) {
    const double share = 1.0 - split.values[i];
    if (!(share >= kMinTrueInformation)) continue;
    keep[i] = 1.0;
    true_share[i] = share;
  }
  const Matrix6d basis = color * split_axes;
  const Matrix6d dual = whiten * split_axes;
  const Vector6d kept_gradient = keep.cwiseProduct(dual.transpose() * pair.gradient);
  pair.gradient = basis * kept_gradient;
  pair.hessian = basis * keep.asDiagonal() * basis.transpose();
  pair.information = basis * true_share.asDiagonal() * basis.transpose();
}

}  // namespace

PairInformation SumPair(const ViewPair& pair, const SurfaceSet& set,
                        const std::vector<Transform>& poses) {
  PairInformation out;
  out.first = pair.first;
  out.second = pair.second;
  std::vector<MatchGeometry> geometry;
  std::vector<double> weights;
  for (const bool from_first : {true, false}) {
    for (const Match& match : from_first ? pair.from_first : pair.from_second) {
      geometry.push_back(ComputeMatch(pair, match, from_first, set, poses));
      weights.push_back(match.weight);
    }
  }
  if (geometry.empty()) return out;
  const Extent extent = MeasureOverlap(geometry);
  const double radius = std::max(extent.radius_m, 1e-9);
  Matrix6d noise = Matrix6d::Zero();
  for (std::size_t i = 0; i < geometry.size(); ++i) {
    const Eigen::Vector3d arm = geometry[i].middle - extent.center;
    const Vector6d row = Row(arm, geometry[i].normal, radius);
    const Vector6d noise_row = Row(arm, geometry[i].difference, radius);
    out.hessian.noalias() += weights[i] * row * row.transpose();
    out.gradient += weights[i] * geometry[i].residual_m * row;
    noise.noalias() += weights[i] * noise_row * noise_row.transpose();
  }
  out.S.topLeftCorner<3, 3>() = radius * Eigen::Matrix3d::Identity();
  out.S.bottomLeftCorner<3, 3>() = -Hat(extent.center);
  DropEmptyDirections(out, noise);
  return out;
}

Matrix6d InformationOf(const Matrix6d& covariance) {
  const dense::SymmetricEigen eigen = dense::DecomposeSymmetric(covariance);
  const Vector6d values = eigen.values.cwiseMax(kMinPriorSigma * kMinPriorSigma);
  const Matrix6d axes = eigen.vectors;
  return axes * values.cwiseInverse().asDiagonal() * axes.transpose();
}

}  // namespace fringe_fusion
