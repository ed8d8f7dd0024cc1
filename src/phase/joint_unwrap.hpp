#pragma once

#include <vector>

#include "step_fit.hpp"

namespace fringe_fusion::decode {

/// A coordinate with the odds of its fringe order.
struct Unwrapped {
  double coordinate_px = 0.0;
  double variance_px2 = 0.0;
  double log_odds = 0.0;  ///< of this order against all others together
  RowStatus status = kRowValid;
};

/// Finds the orders of several frequencies at once by maximum likelihood: heterodyne sets, coprime
/// periods and any other set that does not repeat within the axis. Every order of the finest set is
/// a candidate; its cost is the squared deviation of all other sets, weighted by their covariance.
/// Ref: science section 2.3 (heterodyne, number-theoretic). One object per thread.
class JointUnwrap {
 public:
  /// @param sets by rising number of fringes, at least two.
  JointUnwrap(const std::vector<PhaseSet>& sets, int size_px, const DecodeContext& context);

  /// @param fits of the same sets.
  [[nodiscard]] Unwrapped Run(const std::vector<StepFit>& fits, std::size_t x);

 private:
  struct Candidate {
    int index = -1;
    double cost = 0.0;
    double log_odds = 0.0;
  };

  void PrepareCosts(const std::vector<StepFit>& fits, std::size_t x);
  [[nodiscard]] Candidate FindBest(double reference_cycles, double reference_sigma) const;
  [[nodiscard]] Unwrapped Fuse(const std::vector<StepFit>& fits, std::size_t x, double ratio) const;

  std::vector<double> fringes_;
  int size_px_ = 0;
  DecodeContext context_;
  int num_orders_ = 0;      ///< candidates 0 .. num_orders_ - 1 stand for orders from -1
  int num_candidates_ = 0;  ///< padded
  double systematic2_ = 0.0;
  std::vector<float> offsets_, residuals_, weights_, ratios_, cost_, scratch_;
  float coupling_ = 0.0F;
};

}  // namespace fringe_fusion::decode
