#include "lit_pixels.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace fringe_fusion::diagnosis {
namespace {

// A share of the scene's own light separates it from glow and flickering lamps; noise decides in
// the dark.
constexpr double kMinLightRatio = 0.2;
constexpr double kMinRangeSigma = 6.0;

}  // namespace

double NoiseSigma(const PhaseConfig& phase, double level_dn) {
  return std::sqrt(phase.read_noise_dn * phase.read_noise_dn +
                   phase.gain_dn * std::max(level_dn, 0.0) + 1.0 / 12.0);
}

LightRange FindLightRange(const SampledStack& stack, const PhaseConfig& phase) {
  LightRange range{stack.frames.front(), stack.frames.front(),
                   Image<std::uint8_t>(stack.width(), stack.height()), 0};
  for (const Image<float>& frame : stack.frames) {
    for (std::size_t i = 0; i < stack.size(); ++i) {
      range.dark[i] = std::min(range.dark[i], frame[i]);
      range.bright[i] = std::max(range.bright[i], frame[i]);
    }
  }
  std::vector<float> spans(stack.size());
  for (std::size_t i = 0; i < spans.size(); ++i) spans[i] = range.bright[i] - range.dark[i];
  // Not the brightest pixel: it may be a glint or a defect.
  const auto top = spans.begin() +
                   static_cast<std::ptrdiff_t>(0.995 * (static_cast<double>(spans.size()) - 1.0));
  std::nth_element(spans.begin(), top, spans.end());
  const double floor_dn = kMinLightRatio * static_cast<double>(*top);
  for (std::size_t i = 0; i < stack.size(); ++i) {
    const auto span = static_cast<double>(range.bright[i] - range.dark[i]);
    const double noise_dn = NoiseSigma(phase, static_cast<double>(range.dark[i]));
    range.lit[i] = span > std::max(floor_dn, kMinRangeSigma * noise_dn) ? 1 : 0;
    range.num_lit += range.lit[i];
  }
  return range;
}

}  // namespace fringe_fusion::diagnosis
