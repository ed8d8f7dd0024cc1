#include "light_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

namespace fringe_fusion::diagnosis {
namespace {

void CheckSaturation(const SampledStack& stack, const LightRange& range, const PhaseConfig& phase,
                     const DiagnosisConfig& config, Findings& findings) {
  const double limit_dn = phase.saturation_ratio * static_cast<double>(stack.full_scale_dn);
  int saturated = 0;
  for (std::size_t i = 0; i < stack.size(); ++i) {
    if (static_cast<double>(range.bright[i]) >= limit_dn) ++saturated;
  }
  const int seen = std::max({range.num_lit, saturated, 1});
  const double share = static_cast<double>(saturated) / seen;
  if (findings.Measure(FindingKind::kSaturation, "share of the lit pixels that saturate", share,
                       config.max_saturated_ratio, "")) {
    return;
  }
  findings.Explain(
      fmt::format("{:.1f} % of the lit pixels reach {:.0f} of {:.0f} grey values, limit {:.1f} %",
                  100.0 * share, limit_dn, stack.full_scale_dn, 100.0 * config.max_saturated_ratio),
      "shorten the exposure or dim the projector; if dark parts then lack light, add a second "
      "exposure to the sequence (exposures: \"1,0.3\")");
}

// Amplitude of a pattern of full swing over the noise at its mean level, as the median.
double MedianSignalSigma(const LightRange& range, const PhaseConfig& phase) {
  std::vector<double> ratios;
  for (std::size_t i = 0; i < range.lit.size(); ++i) {
    if (range.lit[i] == 0) continue;
    const double low = static_cast<double>(range.dark[i]);
    const double high = static_cast<double>(range.bright[i]);
    ratios.push_back(0.5 * (high - low) / NoiseSigma(phase, 0.5 * (high + low)));
  }
  if (ratios.empty()) return 0.0;
  const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), middle, ratios.end());
  return *middle;
}

}  // namespace

void CheckLight(const SampledStack& stack, const LightRange& range, const PhaseConfig& phase,
                const DiagnosisConfig& config, Findings& findings) {
  CheckSaturation(stack, range, phase, config, findings);
  const double signal = MedianSignalSigma(range, phase);
  if (findings.Measure(FindingKind::kTooLittleLight,
                       "median fringe amplitude of the lit pixels over the noise", signal,
                       config.min_signal_sigma, "sigma", true)) {
    return;
  }
  findings.Explain(
      fmt::format("the fringes swing by {:.1f} sigma of the sensor noise in the median of {} lit "
                  "pixels, must be at least {:.1f}",
                  signal, range.num_lit, config.min_signal_sigma),
      "expose longer, open the lens, or brighten the projector; check that it shines on the part");
}

}  // namespace fringe_fusion::diagnosis
