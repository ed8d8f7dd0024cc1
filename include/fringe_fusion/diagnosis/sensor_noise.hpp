#pragma once

#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/diagnosis/diagnosis_config.hpp"
#include "fringe_fusion/phase/phase_map.hpp"

namespace fringe_fusion {

/// Noise of one grey value I [DN]: sigma_I^2 = read^2 + gain I + quantisation^2. The standard
/// deviations are those of the estimates; read and gain are correlated.
struct SensorNoise {
  double read_noise_dn = 0.0;
  double gain_dn = 0.0;
  double quantisation_dn = 0.0;  ///< step / sqrt(12), where step is the spacing of the grey values
  double sigma_read_noise_dn = 0.0;
  double sigma_gain_dn = 0.0;
  double sigma_quantisation_dn = 0.0;  ///< 0: the spacing is counted, not measured
  double read_gain_correlation = 0.0;
  /// Rest of the residuals that grows with the fringe amplitude [of B], per axis of the finest set:
  /// rounding of the picture in a still scene, motion in one that moves.
  double relative_residual = 0.0;
  double sigma_relative_residual = 0.0;
  int num_samples = 0;  ///< residuals used
};

/// Photon transfer from one scan: the residuals of every N-step fit (N >= 4), the differences of
/// the mean levels of two sets (any N), and of (white + black) / 2 where both were taken, all give
/// a variance that is linear in the mean grey value A. Regressed on 1, A, and, per set, B^2, which
/// takes what is proportional to the pattern (its rounding, motion). Grey values near 0 or full
/// scale are left out by their fitted value, which is independent of their residual.
/// @return error when no set has residuals, too few pixels remain, or all have the same grey value.
/// Ref: Janesick, "Photon Transfer", SPIE 2007, ch. 5 (variance = read^2 + gain * signal);
/// science section 2.1 (residual with N - 3 degrees of freedom).
[[nodiscard]] Result<SensorNoise> EstimateSensorNoise(const ImageStack& stack,
                                                      const DiagnosisConfig& config);

/// The decoder's settings for one scan: with the scan's own noise if config.estimate_noise, else as
/// is.
/// @return error of the estimate.
[[nodiscard]] Result<PhaseConfig> WithSensorNoise(const PhaseConfig& phase, const ImageStack& stack,
                                                  const DiagnosisConfig& config);

}  // namespace fringe_fusion
