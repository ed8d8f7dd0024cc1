#pragma once

#include <complex>
#include <vector>

#include "step_factors.hpp"

namespace fringe_fusion::diagnosis {

/// Second Fourier coefficient over the steps of one set, R = 1/N sum_n I_n exp(-4 pi i n / N),
/// which a still scene under steady light does not have, as
///   R = level L + ambient K + B (plus e^{i phi} + minus e^{-i phi} + low e^{-2 i phi} + high e^{i
///   (N-2) phi}).
/// L: projector's mean light, K: grey value without it. level: gain that changes from frame to
/// frame, ambient: light that does. plus, minus: shift of the fringes, or gain. low: half the
/// second harmonic of the response. Ref: science sections 2.1, 2.2, 2.8; derived with I_n of a step
/// that is off by a small phase.
struct ResidualFit {
  std::complex<double> plus;
  std::complex<double> minus;
  std::complex<double> low;
  double variance_shift = 0.0;  ///< of |plus|^2 + |minus|^2, by the scatter of the pixels
  double variance_low = 0.0;    ///< of |low|^2
};

/// Fits one set of at least 4 steps over some rows of `samples`; rows that fit badly (edges,
/// dust) are left out in a second round.
[[nodiscard]] ResidualFit FitResidual(const StepSamples& samples, std::size_t set,
                                      const std::vector<Eigen::Index>& rows);

/// Rows of the samples, grouped by square blocks of the image with at least `min_rows` of them.
[[nodiscard]] std::vector<std::vector<Eigen::Index>> MakeBlocks(const StepSamples& samples,
                                                                int width, int height,
                                                                int blocks_across,
                                                                std::size_t min_rows);

}  // namespace fringe_fusion::diagnosis
