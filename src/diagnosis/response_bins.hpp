#pragma once

#include <array>

#include "fringe_fusion/diagnosis/response.hpp"
#include "stack_sampling.hpp"

namespace fringe_fusion::diagnosis {

/// Grey values between black and white, collected by the 8-bit value that was projected.
class ResponseBins {
 public:
  /// @param light wanted, 0..1. @param signal_dn grey value above black.
  /// @param span_dn white minus black of the pixel: its weight; 0 leaves it out.
  void Add(double light, double signal_dn, double span_dn);

  void Add(const ResponseBins& other);
  [[nodiscard]] bool empty() const;  ///< nothing with weight was added

  /// Weighted mean per value, made rising, between the values interpolated by a monotone cubic.
  /// @return error when fewer than three values were seen.
  /// Ref: Fritsch & Carlson, "Monotone piecewise cubic interpolation", SIAM J. Numer. Anal. 17,
  /// 1980; pool adjacent violators: Barlow et al., "Statistical inference under order
  /// restrictions", 1972.
  [[nodiscard]] Result<ResponseCurve> Curve() const;

 private:
  std::array<double, 256> signal_{};
  std::array<double, 256> weight_{};
};

/// The image in kPartsPerSide x kPartsPerSide parts, which tell how far a result varies.
constexpr std::size_t kPartsPerSide = 4;
using BinsOfParts = std::array<ResponseBins, kPartsPerSide * kPartsPerSide>;
/// Part in which a sample lies.
[[nodiscard]] std::size_t PartOf(const SampledStack& stack, std::size_t sample);

/// Bins of a scan: every set but the finest of its axis, at the phase that the finest one gives; an
/// axis with one set at that set's own phase.
[[nodiscard]] BinsOfParts CollectResponse(const SampledStack& stack, const SequencePlan& plan);

/// The curve of all parts, with its gamma and the standard deviation of that over the parts.
[[nodiscard]] Result<ResponseCurve> FitResponse(const BinsOfParts& parts);

}  // namespace fringe_fusion::diagnosis
