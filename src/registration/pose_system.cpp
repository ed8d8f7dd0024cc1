#include "fringe_fusion/registration/pose_system.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

namespace fringe_fusion {
namespace {

// Smallest share of the strongest eigenvalue that is more than rounding.
constexpr double kMinRelativeEigenvalue = 1e-7;
// Smallest share of a direction's information that must not come from noise of the normals.
constexpr double kMinTrueInformation = 0.5;
constexpr double kMinPriorSigma = 1e-8;

std::size_t At(int i) { return static_cast<std::size_t>(i); }

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
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(pair.hessian);
  const Vector6d values = eigen.eigenvalues();
  Vector6d root = Vector6d::Zero();
  Vector6d inverse_root = Vector6d::Zero();
  for (int i = 0; i < 6; ++i) {
    if (!(values[i] > kMinRelativeEigenvalue * values[5])) continue;
    root[i] = std::sqrt(values[i]);
    inverse_root[i] = 1.0 / root[i];
  }
  // In the whitened coordinates the Hessian is the identity and the noise has eigenvalues 0..1;
  // directions already dropped have zero columns in both maps and stay out.
  const Matrix6d whiten = eigen.eigenvectors() * inverse_root.asDiagonal();
  const Matrix6d color = eigen.eigenvectors() * root.asDiagonal();
  const Matrix6d white_noise = whiten.transpose() * noise * whiten;
  const Eigen::SelfAdjointEigenSolver<Matrix6d> split(white_noise);
  Vector6d keep = Vector6d::Zero();
  Vector6d true_share = Vector6d::Zero();
  for (int i = 0; i < 6; ++i) {
    const double share = 1.0 - split.eigenvalues()[i];
    if (!(share >= kMinTrueInformation)) continue;
    keep[i] = 1.0;
    true_share[i] = share;
  }
  const Matrix6d basis = color * split.eigenvectors();
  const Matrix6d dual = whiten * split.eigenvectors();
  const Vector6d kept_gradient = keep.cwiseProduct(dual.transpose() * pair.gradient);
  pair.gradient = basis * kept_gradient;
  pair.hessian = basis * keep.asDiagonal() * basis.transpose();
  pair.information = basis * true_share.asDiagonal() * basis.transpose();
}

// Inverse right Jacobian of SE(3): Log(Exp(e) Exp(xi)) = e + J xi, to second order in e.
Matrix6d InverseRightJacobian(const Vector6d& e) {
  Matrix6d ad = Matrix6d::Zero();
  ad.topLeftCorner<3, 3>() = Hat(e.head<3>());
  ad.bottomRightCorner<3, 3>() = Hat(e.head<3>());
  ad.bottomLeftCorner<3, 3>() = Hat(e.tail<3>());
  return Matrix6d::Identity() + 0.5 * ad + ad * ad / 12.0;
}

struct System {
  Eigen::MatrixXd hessian;
  Eigen::MatrixXd information;
  Eigen::VectorXd gradient;

  explicit System(Eigen::Index size)
      : hessian(Eigen::MatrixXd::Zero(size, size)),
        information(Eigen::MatrixXd::Zero(size, size)),
        gradient(Eigen::VectorXd::Zero(size)) {}

  void AddBlock(int row, int column, const Matrix6d& hessian_block,
                const Matrix6d& information_block) {
    hessian.block<6, 6>(6 * row, 6 * column) += hessian_block;
    information.block<6, 6>(6 * row, 6 * column) += information_block;
  }
};

void AddPair(const PairInformation& pair, const std::vector<int>& slot,
             const std::vector<Transform>& poses, double data_scale, System& system) {
  const std::array<int, 2> slots = {slot[At(pair.first)], slot[At(pair.second)]};
  const std::array<Matrix6d, 2> G = {pair.S * Adjoint(poses[At(pair.first)]),
                                     -pair.S * Adjoint(poses[At(pair.second)])};
  for (std::size_t a = 0; a < 2; ++a) {
    if (slots[a] < 0) continue;
    system.gradient.segment<6>(6 * slots[a]) += G[a].transpose() * pair.gradient / data_scale;
    for (std::size_t b = 0; b < 2; ++b) {
      if (slots[b] < 0) continue;
      system.AddBlock(slots[a], slots[b], G[a].transpose() * pair.hessian * G[b] / data_scale,
                      G[a].transpose() * pair.information * G[b] / data_scale);
    }
  }
}

void AddConstraint(const PoseConstraint& constraint, const Transform& T_object_camera,
                   const ViewSurface& surface, int slot, System& system) {
  Matrix6d information = Matrix6d::Zero();
  if (constraint.has_prior) {
    const Vector6d e = Log(constraint.T_object_camera_prior.inverse() * T_object_camera);
    const Matrix6d J = InverseRightJacobian(e);
    information = J.transpose() * constraint.information * J;
    system.gradient.segment<6>(6 * slot) += J.transpose() * (constraint.information * e);
  } else {
    // Known to within its own size, about its own middle.
    const double size = std::max(surface.radius_m(), 1e-6);
    Matrix6d S = Matrix6d::Zero();
    S.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity();
    S.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() / size;
    S.bottomLeftCorner<3, 3>() = -Hat(surface.centroid()) / size;
    information = S.transpose() * S;
  }
  system.AddBlock(slot, slot, information, information);
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

Result<PoseStep> SolvePoses(const std::vector<PairInformation>& pairs,
                            const std::vector<PoseConstraint>& constraints,
                            const std::vector<Transform>& poses, const SurfaceSet& set,
                            double data_scale) {
  std::vector<int> slot(poses.size(), -1);
  int num_free = 0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!constraints[i].held) slot[i] = num_free++;
  }
  if (num_free == 0) return Fail("registration: all {} poses are held", poses.size());
  System system(6 * num_free);
  for (const PairInformation& pair : pairs) AddPair(pair, slot, poses, data_scale, system);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (slot[i] >= 0) AddConstraint(constraints[i], poses[i], set.surfaces[i], slot[i], system);
  }
  const Eigen::VectorXd step = -system.hessian.ldlt().solve(system.gradient);
  const Eigen::MatrixXd covariance = system.information.ldlt().solve(
      Eigen::MatrixXd::Identity(system.information.rows(), system.information.cols()));
  if (!step.allFinite() || !covariance.allFinite()) {
    return Fail("registration: the system of {} poses has no finite solution", num_free);
  }
  PoseStep out;
  // Newton decrement: unlike the marginal covariances it is not blurred by a free common motion.
  const double decrement = -step.dot(system.gradient);
  out.size_sigma = std::sqrt(std::max(0.0, decrement) / (6.0 * num_free));
  for (const int s : slot) {
    if (s < 0) {
      out.xi.push_back(Vector6d::Zero());
      out.covariance.push_back(Matrix6d::Zero());
      continue;
    }
    const Matrix6d block = covariance.block<6, 6>(6 * s, 6 * s);
    out.xi.push_back(step.segment<6>(6 * s));
    out.covariance.push_back(0.5 * (block + block.transpose()));
  }
  return out;
}

Matrix6d InformationOf(const Matrix6d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(covariance);
  const Vector6d values = eigen.eigenvalues().cwiseMax(kMinPriorSigma * kMinPriorSigma);
  return eigen.eigenvectors() * values.cwiseInverse().asDiagonal() *
         eigen.eigenvectors().transpose();
}

}  // namespace fringe_fusion
