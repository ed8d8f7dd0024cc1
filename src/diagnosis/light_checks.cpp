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
      "exposure to the sequence (pattern.yaml: exposures)");
}

}  // namespace

double MedianLight(const SampledStack& stack, const LightRange& range) {
  std::vector<float> spans;
  for (std::size_t i = 0; i < range.lit.size(); ++i) {
    if (range.lit[i] != 0) spans.push_back(range.bright[i] - range.dark[i]);
  }
  if (spans.empty()) return 0.0;
  const auto middle = spans.begin() + static_cast<std::ptrdiff_t>(spans.size() / 2);
  std::nth_element(spans.begin(), middle, spans.end());
  return static_cast<double>(*middle / stack.full_scale_dn);
}

void CheckLight(const SampledStack& shortest, const SampledStack& longest, const PhaseConfig& phase,
                const DiagnosisConfig& config, Findings& findings) {
  CheckSaturation(shortest, FindLightRange(shortest, phase), phase, config, findings);
  const LightRange range = FindLightRange(longest, phase);
  const double light = MedianLight(longest, range);
  if (findings.Measure(FindingKind::kTooLittleLight,
                       "median of white minus black over full scale, lit pixels", light,
                       config.min_light_ratio, "", true)) {
    return;
  }
  findings.Explain(
      fmt::format(
          "white and black differ by {:.1f} % of full scale in the median of {} lit pixels, "
          "must be at least {:.1f} %",
          100.0 * light, range.num_lit, 100.0 * config.min_light_ratio),
      "expose longer, open the lens, or brighten the projector; check that it shines on the part");
}

}  // namespace fringe_fusion::diagnosis
