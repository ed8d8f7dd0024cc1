#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/image.hpp"
#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/diagnosis/diagnosis_config.hpp"
#include "fringe_fusion/pattern/pattern_sequence.hpp"
#include "fringe_fusion/phase/phase_correction.hpp"

namespace fringe_fusion {

/// Where a response is undone: in the pictures that are sent, or in the phases of the scan.
enum class ResponseUse { kPatterns, kPhase };

/// Light that the camera sees for every 8-bit value sent to the projector, relative to black (0)
/// and white (1); rising.
struct ResponseCurve {
  std::array<double, 256> light{};
  double gamma = 1.0;           ///< of the power law nearest to it
  double gamma_residual = 0.0;  ///< rms distance from that power law
  /// Standard deviation of gamma, by leaving out a sixteenth of the image at a time; NaN where
  /// fewer than four parts of the image see the projector, or the curve was not measured.
  double sigma_gamma = std::numeric_limits<double>::quiet_NaN();
  ResponseUse use = ResponseUse::kPatterns;
};

/// The curve (value / 255)^gamma.
[[nodiscard]] ResponseCurve PowerResponse(double gamma);

/// Response from a grey ramp: pictures of one value each, seen by the camera. Pixels are weighted
/// by their light; saturated ones are left out; the curve between the values is interpolated.
/// @param values 0..255 rising, the first 0 and the last 255. @param frames one per value.
/// @return error when the counts differ, frames differ in size, or no pixel sees the projector.
[[nodiscard]] Result<ResponseCurve> MeasureResponse(const std::vector<int>& values,
                                                    const std::vector<CapturedFrame>& frames);

/// Response from an ordinary scan without extra frames: the grey values of the coarser sets against
/// the phase that the finest set gives, between black and white. Of several exposures the one with
/// most usable pixels counts; frames with a carrier are left out.
/// @return error when there is no white, black or phase set, or too few pixels see the projector.
[[nodiscard]] Result<ResponseCurve> ResponseFromScan(const ImageStack& stack,
                                                     const DiagnosisConfig& config);

/// B_k / B_1 of a cosine of full swing that went through the response, k = 0 .. count - 1.
/// Ref: science section 2.2.
[[nodiscard]] std::vector<double> Harmonics(const ResponseCurve& response, int count);

/// The table of an N-step set under a response.
/// @param contrast what blur leaves of the amplitude of the set's fringes, 0..1; harmonic k keeps
///        its power k^2. 1: sharp.
[[nodiscard]] PhaseLut MakePhaseLut(const ResponseCurve& response, int steps,
                                    double contrast = 1.0);
/// Largest |error| [rad]: about |b_{N-1} - b_{N+1}|. Ref: science section 2.2.
[[nodiscard]] double PhaseRipple(const ResponseCurve& response, int steps);

/// Least N whose ripple stays below a third of the phase noise sqrt(2 / N) noise_ratio.
/// @param noise_ratio sigma_I / B. @param max_steps at least 3.
/// @return error naming the ripple left at max_steps: then correct the response.
/// Ref: science section 2.2.
[[nodiscard]] Result<int> ChooseSteps(const ResponseCurve& response, double noise_ratio,
                                      int max_steps);

/// Tables for every phase set of a scan whose patterns were sent as they are. What blur leaves of
/// each set is measured: its amplitude against white minus black, or against the coarsest set of
/// the axis where these were not taken.
/// @return error when CheckCorrectable refuses the sequence; when the scan's own response, where it
/// can be measured, differs from this by more than config.max_gamma_error, as it does where the
/// patterns were corrected; or when the steps of a set are too few for the response: the measured
/// phase then stands nearly still in places, which multiplies the noise.
[[nodiscard]] Result<PhaseCorrection> MakePhaseCorrection(const ResponseCurve& response,
                                                          const ImageStack& stack,
                                                          const DiagnosisConfig& config);

/// DecodePhase, or DecodeCorrectedPhase where a response is given that is used for phases.
/// @return errors of MakePhaseCorrection and of the decoder.
[[nodiscard]] Result<PhaseMap> DecodeWithResponse(const ImageStack& stack, const PhaseConfig& phase,
                                                  const DiagnosisConfig& config,
                                                  const std::optional<ResponseCurve>& response,
                                                  const Progress& progress = NoProgress,
                                                  PhaseMap recycled = {});

/// Value to send for each wanted light v / 255, so that the light is proportional to v.
[[nodiscard]] std::array<std::uint8_t, 256> InverseLut(const ResponseCurve& response);

/// What is undone in the pictures that are sent.
struct PatternCorrection {
  double gamma = 1.0;                     ///< where there is no response; 1: nothing
  std::optional<ResponseCurve> response;  ///< measured with pictures in which nothing was undone
};

/// The picture of one pattern with the response undone, rounded once, to the nearest light.
[[nodiscard]] Image<std::uint8_t> RenderCorrectedPattern(const Pattern& pattern, int width,
                                                         int height, const ResponseCurve& response);
[[nodiscard]] Image<std::uint8_t> RenderCorrectedPattern(const Pattern& pattern, int width,
                                                         int height,
                                                         const PatternCorrection& correction);

/// One N-step set of a plane whose phase is known otherwise, e.g. from a Gray code.
struct GammaSet {
  std::vector<CapturedFrame> frames;  ///< step n in frames[n]
  Image<float> phase_rad;             ///< true phase; NaN: unknown
};
/// Sets that were projected with one pattern gamma: value = 255 light^(1 / pattern_gamma).
struct GammaTrial {
  double pattern_gamma = 1.0;
  std::vector<GammaSet> sets;
};
struct GammaEstimate {
  double gamma = 1.0;
  std::vector<double> exponents;  ///< per trial: power of the grey values of least phase error
};
/// Gamma of projector and camera together from sets with two or more pattern gammas: for each the
/// power that has to be applied to the captured values for the least phase error; it is linear in
/// the pattern gamma, and 1 at the gamma looked for.
/// @return error with fewer than two different pattern gammas, sizes that differ, no known phase,
/// or a power that does not depend on the pattern gamma.
/// Ref: Hoang, Pan, Nguyen, Wang, "Generic gamma correction for accuracy enhancement in
/// fringe-projection profilometry", Optics Letters 35(12), 2010.
[[nodiscard]] Result<GammaEstimate> EstimateGamma(const std::vector<GammaTrial>& trials);

}  // namespace fringe_fusion
