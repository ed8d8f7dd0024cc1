#pragma once

#include <array>
#include <map>
#include <tuple>
#include <vector>

#include "fringe_fusion/diagnosis/capture_assistant.hpp"

namespace fringe_fusion::diagnosis {

/// Deviations of a wrong fringe order: the sets disagree with the finest by these [fringes].
struct WrongOrder {
  std::vector<double> residual_cycles;  ///< one per set but the finest
  double share = 0.0;                   ///< of the axis where that order lies within the projector
};

/// The wrong orders of jointly unwrapped sets that come closest to the true one for equal noise,
/// closest first. @param fringes rising, at least two.
[[nodiscard]] std::vector<WrongOrder> ClosestOrders(const std::vector<double>& fringes,
                                                    std::size_t count);

/// Least weighted distance of a wrong order for a noise of 1 fringe per set.
/// Ref: science section 2.3.
[[nodiscard]] double OrderMargin(const std::vector<double>& fringes);

/// Predicts captures of one scene. What several captures have in common is computed once.
class CapturePredictor {
 public:
  CapturePredictor(const CaptureScene& scene, const PhaseConfig& phase,
                   const CaptureAssistantConfig& config);

  /// @param worth_m a sigma that has to be beaten; a capture that does not has an infinite one.
  [[nodiscard]] CapturePrediction Run(const CaptureSettings& settings, double worth_m);

  /// Loss of modulation by blur. Ref: science section 2.4.
  [[nodiscard]] double Transfer(int axis, double fringes) const;
  /// Peak phase error of an N-step set under the response, blurred. Ref: science section 2.2.
  [[nodiscard]] double Ripple(int axis, double fringes, int steps) const;

 private:
  /// Where the steps fall on the fringe differs from pixel to pixel: as many cases stand for all.
  static constexpr int kNumPlaces = 4;
  /// Normal matrix of (A, B, phase) of one N-step set: aa, ab, ap, bb, bp, pp.
  using Normal = std::array<float, 6>;
  /// What one exposure of one N-step set says about every pixel.
  struct Look {
    std::vector<double> information;  ///< of the phase, no step being saturated [1/rad^2]
    std::vector<double> share;        ///< of the steps that are not saturated
    std::vector<Normal> normals;      ///< kNumPlaces per pixel, without the saturated steps
    std::vector<int> counts;          ///< the steps that are left, likewise
  };
  /// One pixel's state while the orders of one axis are found.
  struct AxisResult {
    double keep = 1.0;         ///< probability that the pixel is neither doubtful nor saturated
    double doubtful = 0.0;     ///< probability that its order is in doubt
    double variance = 0.0;     ///< of the coordinate as a share of the axis
    double noise_ratio = 0.0;  ///< sigma_I / B of the finest set
  };
  /// One phase set of one pixel.
  struct SetNoise {
    double stated = 0.0;  ///< variance that the decoder knows [cycles^2]
    double actual = 0.0;  ///< with the ripple
  };

  /// What the fit of one phase set of one pixel will state.
  struct SetFit {
    double variance_rad2 = 0.0;
    double count = 0.0;  ///< steps that are not saturated
    double keep = 0.0;   ///< probability that three different steps are left
  };

  const Look& LookAt(int axis, double exposure_s, double fringes, int steps);
  [[nodiscard]] Look MakeLook(int axis, double exposure_s, double fringes, int steps) const;
  /// @param views the looks of the set, by rising exposure.
  [[nodiscard]] static SetFit FitSet(const Look* const* views, std::size_t num_exposures, int steps,
                                     std::size_t pixel);
  [[nodiscard]] AxisResult Decode(const CaptureSettings& settings, std::size_t pixel);
  void Nest(const std::vector<double>& fringes, const std::vector<SetNoise>& noise,
            AxisResult& out) const;
  void Join(const std::vector<double>& fringes, const std::vector<SetNoise>& noise,
            AxisResult& out);
  [[nodiscard]] double SolveQuantile(const std::vector<double>& keep,
                                     const std::vector<double>& sigma) const;

  const CaptureScene& scene_;
  const PhaseConfig& phase_;
  const CaptureAssistantConfig& config_;
  std::vector<double> harmonics_;
  double least_log_odds_ = 0.0;
  double unit_quantile_ = 1.0;                                  ///< of |normal| at covered_ratio
  std::map<std::tuple<int, double, double, int>, Look> looks_;  ///< axis, exposure, fringes, steps
  std::map<std::vector<double>, std::vector<WrongOrder>> orders_;
  std::vector<const Look*> views_;  ///< of the capture at hand: by set, then exposure
  std::vector<double> ripples_;
  std::vector<SetNoise> noise_;
};

}  // namespace fringe_fusion::diagnosis
