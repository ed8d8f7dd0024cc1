#include "device_chain.hpp"

#include <algorithm>
#include <cmath>

#include "common/constants.hpp"
#include "common/dense.hpp"

namespace fringe_fusion::chain {
namespace {

constexpr double kMaxChainDamping = 1e12;

/// Normal equations of one link before its correction is eliminated.
struct LinkSums {
  EndMatrix ends = EndMatrix::Zero();
  EndVector ends_gradient = EndVector::Zero();
  Matrix6d own = Matrix6d::Identity();
  EndCoupling coupling = EndCoupling::Zero();
  Vector6d gradient = Vector6d::Zero();
  double cost = 0.0;
};

LinkSums SumLink(const Chain& chain, const TargetCost& target, const ChainState& state,
                 std::size_t k) {
  const Link& link = chain.links[k];
  LinkSums sums;
  if (!(link.weight > 0.0)) return sums;
  const TargetTerms terms = target(k, PredictTarget(chain, state, k), state.lens);
  const LinkJacobian J = JacobianOf(chain, state, k);
  const Vector6d e = Log(state.corrections[k]);
  const Matrix6d by_step = LogJacobian(e);
  const Matrix6d tie = by_step.transpose() * link.information;
  const Eigen::Matrix<double, kNumEnds, 6> ends_hessian = J.by_ends.transpose() * terms.hessian;
  sums.ends = ends_hessian * J.by_ends;
  sums.ends_gradient = J.by_ends.transpose() * terms.gradient;
  sums.own = J.by_correction.transpose() * terms.hessian * J.by_correction + tie * by_step;
  sums.coupling = (ends_hessian * J.by_correction).transpose();
  sums.gradient = J.by_correction.transpose() * terms.gradient + tie * e;
  const Eigen::Matrix<double, kNumLens, kNumEnds> lens_ends = terms.by_lens.transpose() * J.by_ends;
  sums.ends.bottomRows<kNumLens>() += lens_ends;
  sums.ends.rightCols<kNumLens>() += lens_ends.transpose();
  sums.ends.bottomRightCorner<kNumLens, kNumLens>() += terms.lens_hessian;
  sums.ends_gradient.tail<kNumLens>() += terms.lens_gradient;
  sums.coupling.rightCols<kNumLens>() += J.by_correction.transpose() * terms.by_lens;
  sums.cost = terms.cost + e.dot(link.information * e);
  sums.ends *= link.weight;
  sums.ends_gradient *= link.weight;
  sums.own *= link.weight;
  sums.coupling *= link.weight;
  sums.gradient *= link.weight;
  sums.cost *= link.weight;
  return sums;
}

std::vector<LinkSums> SumLinks(const Chain& chain, const TargetCost& target,
                               const ChainState& state) {
  std::vector<LinkSums> all;
  for (std::size_t k = 0; k < chain.links.size(); ++k) {
    all.push_back(SumLink(chain, target, state, k));
  }
  return all;
}

double CostOfChain(const Chain& chain, const TargetCost& target, const ChainState& state) {
  double cost = state.lens.dot(chain.lens_information * state.lens);
  for (std::size_t k = 0; k < chain.links.size(); ++k) {
    const Link& link = chain.links[k];
    if (!(link.weight > 0.0)) continue;
    cost += link.weight * (target(k, PredictTarget(chain, state, k), state.lens).cost +
                           CorrectionCost(link, state.corrections[k]));
  }
  return cost;
}

/// The system of the ends alone.
struct ReducedChain {
  EndMatrix hessian = EndMatrix::Zero();
  EndVector gradient = EndVector::Zero();
  std::vector<Matrix6d> own_inverse;
};

ReducedChain EliminateCorrections(const Chain& chain, const ChainState& state,
                                  const std::vector<LinkSums>& all, double damping) {
  ReducedChain reduced;
  reduced.hessian.bottomRightCorner<kNumLens, kNumLens>() = chain.lens_information;
  reduced.gradient.tail<kNumLens>() = chain.lens_information * state.lens;
  for (const LinkSums& sums : all) {
    Matrix6d own = sums.own;
    own.diagonal() *= 1.0 + damping;
    const Matrix6d inverse = dense::SolveSymmetric(own, Matrix6d::Identity());
    const Eigen::Matrix<double, kNumEnds, 6> share = sums.coupling.transpose() * inverse;
    reduced.hessian += sums.ends - share * sums.coupling;
    reduced.gradient += sums.ends_gradient - share * sums.gradient;
    reduced.own_inverse.push_back(inverse);
  }
  reduced.hessian.diagonal() *= 1.0 + damping;
  return reduced;
}

std::optional<EndVector> StepOfEnds(const ReducedChain& reduced,
                                    const std::vector<Eigen::Index>& free) {
  Eigen::MatrixXd part = reduced.hessian(free, free);
  const Eigen::VectorXd scale = part.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  part = scale.asDiagonal() * part * scale.asDiagonal();
  const Eigen::VectorXd right = scale.cwiseProduct(Eigen::VectorXd(reduced.gradient(free)));
  const auto solved = dense::SolvePositive(part, right);
  if (!solved || !solved->allFinite()) return std::nullopt;
  EndVector step = EndVector::Zero();
  for (std::size_t i = 0; i < free.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    step[free[i]] = -scale[at] * (*solved)(at, 0);
  }
  return step;
}

ChainState MovedChain(const ChainState& state, const std::vector<LinkSums>& all,
                      const ReducedChain& reduced, const EndVector& step) {
  ChainState moved = state;
  const Vector6d carrier = step.head<6>();
  const Vector6d other = step.segment<6>(6);
  moved.lens += step.tail<kNumLens>();
  moved.T_camera_carrier = state.T_camera_carrier * Exp(carrier);
  moved.T_other_target = state.T_other_target * Exp(other);
  for (std::size_t k = 0; k < all.size(); ++k) {
    const Vector6d own = -reduced.own_inverse[k] * (all[k].gradient + all[k].coupling * step);
    moved.corrections[k] = state.corrections[k] * Exp(own);
  }
  return moved;
}

}  // namespace

std::vector<Eigen::Index> Chain::FreeEnds() const {
  std::vector<Eigen::Index> indices;
  for (Eigen::Index i = 0; i < kNumEnds; ++i) {
    if (free[static_cast<std::size_t>(i)]) indices.push_back(i);
  }
  return indices;
}

Transform LinkMotion(const Chain& chain, std::size_t link, const Transform& correction) {
  const Transform T_base_flange = chain.links[link].T_base_flange * correction;
  return chain.in_hand ? T_base_flange.inverse() : T_base_flange;
}

Transform PredictTarget(const Chain& chain, const ChainState& state, std::size_t link) {
  return state.T_camera_carrier * LinkMotion(chain, link, state.corrections[link]) *
         state.T_other_target;
}

LinkJacobian JacobianOf(const Chain& chain, const ChainState& state, std::size_t link) {
  const Transform T_carrier_target =
      LinkMotion(chain, link, state.corrections[link]) * state.T_other_target;
  LinkJacobian J;
  J.by_ends.leftCols<6>() = Adjoint(T_carrier_target.inverse());
  J.by_ends.middleCols<6>(6).setIdentity();
  // In hand: (F Exp(e))^-1 = Exp(-e) F^-1 acts where the carrier's perturbation acts.
  J.by_correction =
      chain.in_hand ? Matrix6d(-J.by_ends.leftCols<6>()) : Adjoint(state.T_other_target.inverse());
  return J;
}

Matrix6d LogJacobian(const Vector6d& e) {
  Matrix6d ad = Matrix6d::Zero();
  ad.topLeftCorner<3, 3>() = Hat(e.head<3>());
  ad.bottomRightCorner<3, 3>() = ad.topLeftCorner<3, 3>();
  ad.bottomLeftCorner<3, 3>() = Hat(e.tail<3>());
  return Matrix6d::Identity() + 0.5 * ad + ad * ad / 12.0;
}

double CorrectionCost(const Link& link, const Transform& correction) {
  const Vector6d e = Log(correction);
  return e.dot(link.information * e);
}

bool SolveChain(const Chain& chain, const TargetCost& target, ChainState& state,
                int max_iterations) {
  double cost = CostOfChain(chain, target, state);
  if (!std::isfinite(cost)) return false;
  double damping = 1e-4;
  const std::vector<Eigen::Index> free = chain.FreeEnds();
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const std::vector<LinkSums> all = SumLinks(chain, target, state);
    bool improved = false;
    double decrease = 0.0;
    while (!improved && damping < kMaxChainDamping) {
      const ReducedChain reduced = EliminateCorrections(chain, state, all, damping);
      const auto step = StepOfEnds(reduced, free);
      if (step) {
        ChainState moved = MovedChain(state, all, reduced, *step);
        const double moved_cost = CostOfChain(chain, target, moved);
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
    constexpr double kConvergedChain = 1e-8;  // in units of one deviation squared
    if (!improved || (decrease < kConvergedChain + 1e-12 * cost && damping < 1e-2)) return true;
  }
  return true;
}

std::optional<ChainCovariance> CovarianceOf(const Chain& chain, const TargetCost& target,
                                            const ChainState& state) {
  const std::vector<LinkSums> all = SumLinks(chain, target, state);
  const ReducedChain reduced = EliminateCorrections(chain, state, all, 0.0);
  const std::vector<Eigen::Index> free = chain.FreeEnds();
  Eigen::MatrixXd part = reduced.hessian(free, free);
  const Eigen::VectorXd scale = part.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  part = scale.asDiagonal() * part * scale.asDiagonal();
  part = 0.5 * (part + part.transpose()).eval();
  if (!part.allFinite()) return std::nullopt;
  const dense::SymmetricEigen eigen = dense::DecomposeSymmetric(part);
  const Eigen::Index last = eigen.values.size() - 1;
  if (!(eigen.values[0] > 1e-15 * eigen.values[last])) return std::nullopt;
  const auto inverse =
      dense::SolvePositive(part, Eigen::MatrixXd::Identity(part.rows(), part.rows()));
  if (!inverse) return std::nullopt;
  ChainCovariance out;
  out.condition = eigen.values[last] / eigen.values[0];
  const Eigen::MatrixXd covariance = scale.asDiagonal() * *inverse * scale.asDiagonal();
  for (std::size_t i = 0; i < free.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    out.weakest[free[i]] = scale[row] * eigen.vectors(row, 0);
    for (std::size_t j = 0; j < free.size(); ++j) {
      const auto column = static_cast<Eigen::Index>(j);
      out.ends(free[i], free[j]) = 0.5 * (covariance(row, column) + covariance(column, row));
    }
  }
  for (std::size_t k = 0; k < all.size(); ++k) {
    const EndCoupling gain = reduced.own_inverse[k] * all[k].coupling;
    Matrix6d own = reduced.own_inverse[k] + gain * out.ends * gain.transpose();
    if (!(chain.links[k].weight > 0.0)) own.setZero();
    out.corrections.push_back(own);
  }
  return out;
}

}  // namespace fringe_fusion::chain
