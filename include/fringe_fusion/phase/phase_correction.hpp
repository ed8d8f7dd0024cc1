#pragma once

#include <vector>

#include "fringe_fusion/pattern/pattern_sequence.hpp"
#include "fringe_fusion/phase/phase_map.hpp"

namespace fringe_fusion {

/// What an N-step set measures of fringes that are no cosines, by the measured phase
/// 2 pi i / size, and the shape of these fringes.
struct PhaseLut {
  int steps = 0;                        ///< N
  std::vector<double> error_rad;        ///< measured less true phase
  std::vector<double> slope;            ///< d true / d measured: that of the noise
  std::vector<double> amplitude_ratio;  ///< measured over true amplitude of the cosine in them
  /// Grey value without its mean, over the amplitude of the cosine, at true phases 2 pi i / size.
  std::vector<double> wave;
};
/// @return the true phase of a measured one, both in (-pi, pi].
[[nodiscard]] double CorrectPhase(const PhaseLut& lut, double phase_rad);

/// The tables of the phase sets of a scan.
struct PhaseCorrection {
  struct Set {
    Axis axis = Axis::kU;
    double fringes = 0.0;
    PhaseLut lut;
  };
  std::vector<Set> sets;
};

/// Whether phases of a sequence can be corrected by a table per set: every axis is coded by even
/// N-step sets, complete at every exposure, with or without Gray code.
/// @return error naming what has no step fit to correct.
[[nodiscard]] Status CheckCorrectable(const PatternSequence& sequence);

/// DecodePhase with the phase of every set corrected by its table. The steps are not weighted,
/// because weights would mix the harmonics into the phase in a way that depends on the grey values;
/// sigma is that of this fit, times the slope of the table. An exposure with a saturated step is
/// left out, the others are joined by inverse variance.
/// @param correction one table per phase set of the sequence.
/// @return also the errors of CheckCorrectable, and of a set without a table of its steps.
/// Ref: science sections 2.1, 2.2 (phase table).
[[nodiscard]] Result<PhaseMap> DecodeCorrectedPhase(const ImageStack& stack,
                                                    const PhaseConfig& config,
                                                    const PhaseCorrection& correction,
                                                    const Progress& progress = NoProgress,
                                                    PhaseMap recycled = {});

}  // namespace fringe_fusion
