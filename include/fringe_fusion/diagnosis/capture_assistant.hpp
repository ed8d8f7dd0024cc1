#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/diagnosis/response.hpp"
#include "fringe_fusion/pattern/pattern_sequence.hpp"
#include "fringe_fusion/phase/phase_map.hpp"

namespace fringe_fusion {

/// What the capture assistant may propose.
struct CaptureAssistantConfig {
  double min_exposure_s = 0.001;
  double max_exposure_s = 0.1;
  double exposure_step_s = 0.0;   ///< exposures are multiples of the projector's frame; 0: any
  int max_exposures = 3;          ///< of every pattern
  double frame_overhead_s = 0.0;  ///< between two exposures; 0: as in the test exposures
  int max_frequencies = 4;
  double min_period_px = 8.0;  ///< shortest fringe [projector px]
  bool both_axes = false;      ///< code u and v even where one says nothing of the depth
  double blur_px = 1.0;        ///< Gaussian sigma assumed where no test frame shows fringes
  double covered_ratio = 0.9;  ///< share of the visible surface that has to be as good as stated
  double max_doubtful_ratio = 0.05;  ///< visible pixels that may be lost to doubtful fringe orders
  int max_samples = 200;             ///< pixels that stand for the visible surface

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("min_exposure_s", min_exposure_s, 1e-6, 100.0);
    field("max_exposure_s", max_exposure_s, 1e-6, 100.0);
    field("exposure_step_s", exposure_step_s, 0.0, 1.0);
    field("max_exposures", max_exposures, 1, 3);
    field("frame_overhead_s", frame_overhead_s, 0.0, 60.0);
    field("max_frequencies", max_frequencies, 2, 4);
    field("min_period_px", min_period_px, 2.0, 1000.0);
    field("both_axes", both_axes);
    field("blur_px", blur_px, 0.0, 100.0);
    field("covered_ratio", covered_ratio, 0.1, 0.999);
    field("max_doubtful_ratio", max_doubtful_ratio, 0.0, 1.0);
    field("max_samples", max_samples, 20, 100000);
  }
};

/// What a capture may cost; exactly one of the two is positive.
struct CaptureBudget {
  int frames = 0;        ///< white and black count
  double seconds = 0.0;  ///< exposures and what lies between them
};

/// @return error unless exactly one of the two is positive.
[[nodiscard]] Status Validate(const CaptureBudget& budget);

/// One way to capture: every code once with each exposure. White and black go before the codes.
struct CaptureSettings {
  std::vector<double> exposures_s;  ///< rising
  std::vector<double> fringes;      ///< rising
  int steps = 0;
  bool axis_u = true;
  bool axis_v = false;
};
[[nodiscard]] int NumFrames(const CaptureSettings& settings);
/// The settings of the pattern stage that show it, at exposures_s[0] as the exposure of the scan.
[[nodiscard]] PatternConfig ToPatternConfig(const CaptureSettings& settings);

/// What test exposures say about the cell and the surface before it.
struct CaptureScene {
  /// One pixel of the visible surface.
  struct Pixel {
    double contrast_dn_s = 0.0;  ///< white minus black per second of exposure
    double black_dn_s = 0.0;     ///< black per second of exposure
    /// Motion of its projector coordinates (u, v) with its range [projector px / m].
    Eigen::Vector2d px_per_m = Eigen::Vector2d::Zero();
  };
  std::vector<Pixel> pixels;
  /// Pixels of the camera that see the projector, and whose fringes max_exposure_s lifts to twice
  /// the least modulation.
  int num_visible = 0;
  double read_noise_dn = 0.0;
  double gain_dn = 0.0;
  double full_scale_dn = 255.0;
  bool measured_noise = false;       ///< false: noise of phase.yaml
  bool measured_fringes = false;     ///< false: blur and response are assumed
  std::array<double, 2> blur_px{};   ///< Gaussian sigma on u and v [projector px]
  double fringe_ratio = 0.5;         ///< fringe amplitude B without blur, of white minus black
  double mean_ratio = 0.5;           ///< mean A minus black, of white minus black
  ResponseCurve response;            ///< of the pattern as it was sent
  std::array<int, 2> size_px{};      ///< projector width and height
  double frame_overhead_s = 0.0;     ///< from the end of one exposure to the start of the next
  double shortest_exposure_s = 0.0;  ///< of the test
  double saturated_ratio = 0.0;      ///< visible pixels saturated at the shortest test exposure
};

/// Measures a scene from white and black frames at one or more exposures and, where there are any,
/// N-step sets: contrast per pixel (exposures joined by least squares, saturated values left out),
/// sensor noise (EstimateSensorNoise, else phase), blur from the loss of modulation with frequency,
/// response, and the range of every pixel (else that where both devices look).
/// @return error when white, black or an exposure time is missing, sizes differ from the
/// calibration, or no pixel sees the projector.
[[nodiscard]] Result<CaptureScene> MeasureCaptureScene(const ImageStack& test,
                                                       const CellCalibration& calibration,
                                                       const PhaseConfig& phase,
                                                       const CaptureAssistantConfig& config);

/// How good a capture will be.
struct CapturePrediction {
  /// Range that `covered_ratio` of the visible surface stays within, as the sigma of a normal error
  /// [m]: the quantile of |error| over the surface, lost pixels counting as infinite, divided by
  /// the same quantile of a unit normal variable. Infinite when more pixels are lost, or more than
  /// max_doubtful_ratio to doubt.
  double sigma_depth_m = 0.0;
  double valid_ratio = 0.0;     ///< of the visible surface
  double noise_ratio = 0.0;     ///< median sigma_I / B of the finest set
  double ripple_rad = 0.0;      ///< of the finest set, peak
  double doubtful_ratio = 0.0;  ///< of the visible surface, lost to the doubt about fringe orders
};

/// Predicts a capture of a scene as DecodePhase would decode it.
/// @return error when the settings are no valid code or a list is empty.
/// Ref: science sections 2.1 (noise), 2.2 (ripple), 2.3 (fringe order), 2.4 (blur), 2.5 (depth),
/// 2.7 (exposures).
[[nodiscard]] Result<CapturePrediction> PredictCapture(const CaptureScene& scene,
                                                       const CaptureSettings& settings,
                                                       const PhaseConfig& phase,
                                                       const CaptureAssistantConfig& config);

struct CaptureProposal {
  CaptureSettings settings;
  CapturePrediction prediction;
  int num_frames = 0;
  double seconds = 0.0;
  int num_compared = 0;            ///< ways to capture that were predicted
  std::vector<std::string> notes;  ///< what was assumed, what else would help
};

/// The settings with the least predicted depth sigma that fit the budget.
/// @return error when the budget is not one positive number, holds no valid code, or no way to
/// capture reaches config.covered_ratio of the visible surface.
[[nodiscard]] Result<CaptureProposal> ProposeCapture(const CaptureScene& scene,
                                                     const PhaseConfig& phase,
                                                     const CaptureAssistantConfig& config,
                                                     const CaptureBudget& budget);

/// What to capture as a test: white, black and a short fringe scan on the axis that moves with the
/// depth (or both), each at a quarter, once and four times the usual exposure.
[[nodiscard]] PatternConfig TestPattern(const CellCalibration& calibration);

}  // namespace fringe_fusion
