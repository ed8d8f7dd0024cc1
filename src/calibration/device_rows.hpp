#pragma once

#include <Eigen/Core>
#include <cmath>

#include "cell_problem.hpp"

namespace fringe_fusion::bundle {

/// The whitened rows of a station's observations by one device, scaled by the square root of their
/// Huber weights: their products are summed at once.
struct DeviceRows {
  Eigen::Matrix<double, kNumLocal, Eigen::Dynamic> jacobian;  ///< two columns per observation
  Eigen::VectorXd e;

  explicit DeviceRows(std::size_t num_observations) {
    const auto num = 2 * static_cast<Eigen::Index>(num_observations);
    jacobian.resize(kNumLocal, num);
    e.resize(num);
  }

  void Set(std::size_t observation, const Linearized& at, double weight) {
    const Eigen::Index column = 2 * static_cast<Eigen::Index>(observation);
    const double factor = std::sqrt(weight);
    jacobian.middleCols<2>(column) = factor * at.jacobian.transpose();
    e.segment<2>(column) = factor * at.e;
  }

  /// Adds J^T J, which is zero outside of the parameters that the device sees.
  void AddTo(std::size_t device, StationSums& sums) const {
    if (device == kProjector) {
      constexpr int kOwn = kNumLocal - kNumModel;
      const auto own = jacobian.bottomRows<kOwn>();
      sums.hessian.bottomRightCorner<kOwn, kOwn>().noalias() += own * own.transpose();
    } else {
      const auto model = jacobian.topRows<kNumModel>();
      const auto placed = jacobian.bottomRows<9>();
      sums.hessian.topLeftCorner<kNumModel, kNumModel>().noalias() += model * model.transpose();
      const Eigen::Matrix<double, kNumModel, 9> mixed = model * placed.transpose();
      sums.hessian.topRightCorner<kNumModel, 9>() += mixed;
      sums.hessian.bottomLeftCorner<9, kNumModel>() += mixed.transpose();
      sums.hessian.bottomRightCorner<9, 9>().noalias() += placed * placed.transpose();
    }
    sums.gradient.noalias() += jacobian * e;
  }
};

}  // namespace fringe_fusion::bundle
