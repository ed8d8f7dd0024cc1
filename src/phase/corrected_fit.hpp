#pragma once

#include <cstddef>
#include <vector>

#include "fringe_fusion/phase/phase_correction.hpp"
#include "set_row.hpp"

namespace fringe_fusion::decode {

/// Least squares without weights of the even steps of one phase set to every pixel of a row, its
/// phase then corrected by a table: phase, variance and amplitude of the cosine in the fringes.
/// Ref: science sections 2.1, 2.2. One object per thread.
class CorrectedFit {
 public:
  /// @param set even at every exposure. @param lut of its number of steps; outlives this.
  CorrectedFit(const PhaseSet& set, const DecodeContext& context, const PhaseLut& lut);

  /// @param frames grey values of the samples of the set, in their order. @param row is replaced.
  void Run(const std::vector<const float*>& frames, SetRow& row);

 private:
  /// The steps at one exposure.
  struct Shot {
    double exposure_ratio = 1.0;
    std::vector<std::size_t> samples;  ///< by step
  };
  /// What is known about one pixel: at one exposure first, of all of them then.
  struct Estimate {
    bool saturated = true;
    double phase_rad = 0.0;
    double information = 0.0;           ///< 1 / variance of the phase
    double measured_information = 0.0;  ///< the same before the table
    double offset_dn = 0.0;
    double amplitude_dn = 0.0;
    double chi2 = 0.0;  ///< of the residuals, to be compared with
    double largest_chi2 = 0.0;
  };

  void Read(const std::vector<const float*>& frames, const Shot& shot, std::size_t x);
  [[nodiscard]] Estimate FitShot(double exposure_ratio) const;
  void AddResiduals(Estimate& fit) const;
  static void Join(const Estimate& one, Estimate& all);
  void Store(const Estimate& fit, std::size_t x, SetRow& row) const;

  const PhaseLut& lut_;
  int width_ = 0;
  RowNoise noise_;
  FitLimits limits_;
  double sign_ = 1.0;
  double offset_rad_ = 0.0;
  std::size_t num_steps_ = 0;
  std::vector<double> deltas_rad_, cosines_, sines_;
  std::vector<Shot> shots_;
  std::vector<double> grey_;      ///< of the pixel at hand, by step
  std::vector<double> variance_;  ///< of these
};

}  // namespace fringe_fusion::decode
