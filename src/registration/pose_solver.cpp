#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "at.hpp"
#include "common/dense.hpp"
#include "fringe_fusion/registration/pose_system.hpp"

namespace fringe_fusion {
namespace {

// Size in standard deviations from which a device counts less.
constexpr double kFullSigma = 3.0;

// Inverse right Jacobian of SE(3): Log(Exp(e) Exp(xi)) = e + J xi, to second order in e.
Matrix6d InverseRightJacobian(const Vector6d& e) {
  Matrix6d ad = Matrix6d::Zero();
  ad.topLeftCorner<3, 3>() = Hat(e.head<3>());
  ad.bottomRightCorner<3, 3>() = Hat(e.head<3>());
  ad.bottomLeftCorner<3, 3>() = Hat(e.tail<3>());
  return Matrix6d::Identity() + 0.5 * ad + ad * ad / 12.0;
}

// Size of a residual with six components of unit variance in units of what counts fully.
double Excess(const Vector6d& e, const Matrix6d& information) {
  return std::sqrt(std::max(0.0, e.dot(information * e)) / 6.0) / kFullSigma;
}

// Huber: a start that is far off still feels where to go.
double HuberWeight(const Vector6d& e, const Matrix6d& information) {
  return 1.0 / std::max(1.0, Excess(e, information));
}

// Redescending: a device is often far more accurate than a surface, and the constant pull of Huber
// at 3 of its small standard deviations would bend the surface.
double OutlierWeight(const Vector6d& e, const Matrix6d& information) {
  const double excess = std::max(1.0, Excess(e, information));
  return 1.0 / (excess * excess * excess);
}

struct Block {
  int slot = -1;  // of the unknown, -1: held
  Matrix6d jacobian;
};

struct System {
  Eigen::MatrixXd hessian;
  Eigen::MatrixXd information;
  Eigen::VectorXd gradient;
  bool far_off = false;  // contradictions come from the start, not from outliers

  explicit System(Eigen::Index size)
      : hessian(Eigen::MatrixXd::Zero(size, size)),
        information(Eigen::MatrixXd::Zero(size, size)),
        gradient(Eigen::VectorXd::Zero(size)) {}

  // Adds J^T W J and J^T g of one residual; `believed` is W without what is not real information.
  void Add(const std::vector<Block>& blocks, const Matrix6d& weight, const Matrix6d& believed,
           const Vector6d& weighted_residual) {
    for (const Block& a : blocks) {
      if (a.slot < 0) continue;
      gradient.segment<6>(6 * a.slot) += a.jacobian.transpose() * weighted_residual;
      for (const Block& b : blocks) {
        if (b.slot < 0) continue;
        hessian.block<6, 6>(6 * a.slot, 6 * b.slot) += a.jacobian.transpose() * weight * b.jacobian;
        information.block<6, 6>(6 * a.slot, 6 * b.slot) +=
            a.jacobian.transpose() * believed * b.jacobian;
      }
    }
  }
  void AddResidual(const std::vector<Block>& blocks, const Matrix6d& information_of,
                   const Vector6d& e) {
    const double robust =
        far_off ? HuberWeight(e, information_of) : OutlierWeight(e, information_of);
    const Matrix6d weight = robust * information_of;
    Add(blocks, weight, weight, weight * e);
  }
};

void AddPair(const PairInformation& pair, const std::vector<int>& slot, const PoseState& state,
             double data_scale, System& system) {
  const std::vector<Block> blocks = {
      {slot[At(pair.first)], pair.S * Adjoint(state.poses[At(pair.first)])},
      {slot[At(pair.second)], -pair.S * Adjoint(state.poses[At(pair.second)])}};
  system.Add(blocks, pair.hessian / data_scale, pair.information / data_scale,
             pair.gradient / data_scale);
}

// Known to within its own size, about its own middle.
Matrix6d SizeInformation(double radius_m, const Eigen::Vector3d& middle) {
  const double size = std::max(radius_m, 1e-6);
  Matrix6d S = Matrix6d::Zero();
  S.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity();
  S.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() / size;
  S.bottomLeftCorner<3, 3>() = -Hat(middle) / size;
  return S.transpose() * S;
}

void AddConstraint(const PoseConstraint& constraint, const Transform& T, int slot,
                   const Matrix6d& if_unknown, System& system) {
  if (constraint.has_prior) {
    const Vector6d e = Log(constraint.T_object_camera_prior.inverse() * T);
    system.AddResidual({{slot, InverseRightJacobian(e)}}, constraint.information, e);
  } else {
    system.Add({{slot, Matrix6d::Identity()}}, if_unknown, if_unknown, Vector6d::Zero());
  }
}

void AddTie(const PoseTie& tie, const std::vector<int>& slot, const PoseState& state,
            System& system) {
  // e = Log(T_fs^-1 T_f^-1 T_s).
  const Vector6d e = TieResidual(tie, state);
  const Transform T_first_second =
      state.poses[At(tie.first)].inverse() * state.poses[At(tie.second)];
  const Matrix6d J = InverseRightJacobian(e);
  system.AddResidual(
      {{slot[At(tie.second)], J}, {slot[At(tie.first)], -J * Adjoint(T_first_second.inverse())}},
      tie.information, e);
}

void AddChain(const ChainTerm& chain, const std::vector<int>& slot, const PoseState& state,
              int base_slot, System& system) {
  const Matrix6d information = ChainInformation(chain, state);
  for (std::size_t i = 0; i < chain.views.size(); ++i) {
    const Vector6d e = ChainResidual(chain, i, state);
    const Matrix6d J_left = InverseRightJacobian(-e);
    const Transform rest = chain.motions[i] * state.T_flange_camera;
    system.AddResidual({{slot[At(chain.views[i])], InverseRightJacobian(e)},
                        {base_slot, -J_left * Adjoint(rest.inverse())},
                        {base_slot + 1, -J_left}},
                       information, e);
  }
  const Matrix6d unknown = SizeInformation(1.0, Eigen::Vector3d::Zero());
  AddConstraint(chain.object_base, state.T_object_base, base_slot, unknown, system);
  AddConstraint(chain.flange_camera, state.T_flange_camera, base_slot + 1, unknown, system);
}

// Sum of squares of the readings, and one damped step for the mountings alone.
double FitMountings(const ChainTerm& chain, PoseState& state) {
  const std::vector<int> held(state.poses.size(), -1);
  double cost = 0.0;
  for (int iteration = 0; iteration < 40; ++iteration) {
    System system(12);
    system.far_off = true;
    AddChain(chain, held, state, 0, system);
    const Eigen::VectorXd step = -dense::SolveSymmetric(system.hessian, system.gradient);
    if (!step.allFinite()) return INFINITY;
    state.T_object_base = state.T_object_base * Exp(step.head<6>());
    state.T_flange_camera = state.T_flange_camera * Exp(step.tail<6>());
    cost = 0.0;
    const Matrix6d information = ChainInformation(chain, state);
    for (std::size_t i = 0; i < chain.views.size(); ++i) {
      const Vector6d e = ChainResidual(chain, i, state);
      cost += HuberWeight(e, information) * e.dot(information * e);
    }
    if (step.norm() < 1e-10) break;
  }
  return std::isfinite(cost) ? cost : INFINITY;
}

}  // namespace

Vector6d TieResidual(const PoseTie& tie, const PoseState& state) {
  return Log(tie.T_first_second.inverse() * state.poses[At(tie.first)].inverse() *
             state.poses[At(tie.second)]);
}

Vector6d ChainResidual(const ChainTerm& chain, std::size_t reading, const PoseState& state) {
  const Transform T = state.T_object_base * chain.motions[reading] * state.T_flange_camera;
  return Log(T.inverse() * state.poses[At(chain.views[reading])]);
}

Matrix6d ChainInformation(const ChainTerm& chain, const PoseState& state) {
  // Y M Exp(x) X = Y M X Exp(Ad(X^-1) x).
  const Matrix6d A = Adjoint(state.T_flange_camera);
  return A.transpose() * chain.information * A;
}

void StartChain(const ChainTerm& chain, PoseState& state) {
  PoseState best = state;
  double best_cost = INFINITY;
  for (int start = 0; start < 24; ++start) {
    PoseState trial = state;
    const int axis = start / 4;
    const Eigen::Vector3d up = (axis % 2 == 0 ? 1.0 : -1.0) * Eigen::Vector3d::Unit(axis / 2);
    trial.T_flange_camera = Transform::Identity();
    trial.T_flange_camera.linear() =
        Eigen::AngleAxisd(M_PI_2 * (start % 4), up).toRotationMatrix() *
        RotationBetween(Eigen::Vector3d::UnitZ(), up);
    if (chain.flange_camera.has_prior) {
      trial.T_flange_camera = chain.flange_camera.T_object_camera_prior;
    }
    trial.T_object_base = chain.object_base.has_prior
                              ? chain.object_base.T_object_camera_prior
                              : state.poses[At(chain.views.front())] *
                                    (chain.motions.front() * trial.T_flange_camera).inverse();
    const double cost = FitMountings(chain, trial);
    if (cost < best_cost * (1.0 - 1e-9)) {
      best_cost = cost;
      best = trial;
    }
    if (chain.flange_camera.has_prior) break;
  }
  state = best;
}

Result<PoseStep> SolvePoses(const std::vector<PairInformation>& pairs, const PoseTerms& terms,
                            const PoseState& state, const SurfaceSet& set, double data_scale) {
  std::vector<int> slot(state.poses.size(), -1);
  int num_free = 0;
  for (std::size_t i = 0; i < state.poses.size(); ++i) {
    if (!terms.constraints[i].held) slot[i] = num_free++;
  }
  if (num_free == 0) return Fail("registration: all {} poses are held", state.poses.size());
  const int num_unknowns = num_free + (terms.chain ? 2 : 0);
  System system(6 * num_unknowns);
  for (const PairInformation& pair : pairs) AddPair(pair, slot, state, data_scale, system);
  for (std::size_t i = 0; i < slot.size(); ++i) {
    if (slot[i] < 0) continue;
    AddConstraint(terms.constraints[i], state.poses[i], slot[i],
                  SizeInformation(set.surfaces[i].radius_m(), set.surfaces[i].centroid()), system);
  }
  for (const PoseTie& tie : terms.ties) AddTie(tie, slot, state, system);
  if (terms.chain) AddChain(*terms.chain, slot, state, num_free, system);
  const Eigen::VectorXd step = -dense::SolveSymmetric(system.hessian, system.gradient);
  const Eigen::MatrixXd covariance = dense::SolveSymmetric(
      system.information,
      Eigen::MatrixXd::Identity(system.information.rows(), system.information.cols()));
  if (!step.allFinite() || !covariance.allFinite()) {
    return Fail("registration: the system of {} poses has no finite solution", num_free);
  }
  PoseStep out;
  // Newton decrement: unlike the marginal covariances it is not blurred by a free common motion.
  const double decrement = -step.dot(system.gradient);
  out.size_sigma = std::sqrt(std::max(0.0, decrement) / (6.0 * num_unknowns));
  const auto block = [&](int s) -> Matrix6d {
    const Matrix6d one = covariance.block<6, 6>(6 * s, 6 * s);
    return 0.5 * (one + one.transpose());
  };
  for (const int s : slot) {
    out.xi.push_back(s < 0 ? Vector6d::Zero().eval() : step.segment<6>(6 * s).eval());
    out.covariance.push_back(s < 0 ? Matrix6d::Zero().eval() : block(s));
  }
  for (int k = 0; terms.chain && k < 2; ++k) {
    out.xi_chain.at(At(k)) = step.segment<6>(6 * (num_free + k));
    out.covariance_chain.at(At(k)) = block(num_free + k);
  }
  return out;
}

}  // namespace fringe_fusion
