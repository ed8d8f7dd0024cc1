#include "fringe_measures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "common/constants.hpp"
#include "common/median.hpp"
#include "step_residuals.hpp"

namespace fringe_fusion::diagnosis {
namespace {

constexpr std::size_t kMaxPixels = 20000;
constexpr std::size_t kMinPixels = 200;
constexpr int kBlocksAcross = 16;
constexpr std::size_t kMinBlockPixels = 50;

// Rms over blocks of the median difference of two phases, less what noise gives medians.
// Indirect light is smooth: it moves whole blocks, noise does not.
double BlockDisagreement(const std::vector<std::vector<Eigen::Index>>& blocks,
                         const StepSamples& samples, const Image<float>& phase,
                         const Image<float>& expected) {
  double squares = 0.0;
  for (const std::vector<Eigen::Index>& rows : blocks) {
    std::vector<double> apart;
    for (const Eigen::Index row : rows) {
      const std::size_t pixel = samples.pixels[static_cast<std::size_t>(row)];
      apart.push_back(std::remainder(static_cast<double>(phase[pixel] - expected[pixel]), kTwoPi));
    }
    const double middle = Median(apart);
    for (double& value : apart) value = std::abs(value - middle);
    const double sigma = 1.4826 * Median(apart);
    // Variance of a median: pi / 2 of that of a mean.
    squares += middle * middle - 0.25 * kTwoPi * sigma * sigma / static_cast<double>(rows.size());
  }
  return std::sqrt(std::max(0.0, squares / static_cast<double>(blocks.size())));
}

}  // namespace

FringeMeasures MeasureFringes(const SampledStack& stack, const SequencePlan& plan,
                              const LightRange& range) {
  FringeMeasures measures;
  const StepSamples samples = SelectStepSamples(stack, plan, range, true, kMaxPixels);
  if (samples.pixels.size() < kMinPixels) {
    measures.skipped = fmt::format("{} unsaturated lit pixels inside, needs {}",
                                   samples.pixels.size(), kMinPixels);
    return measures;
  }
  const auto blocks =
      MakeBlocks(samples, stack.width(), stack.height(), kBlocksAcross, kMinBlockPixels);
  std::vector<StepFit> fits;
  for (const StepSet& set : plan.sets) fits.push_back(FitSteps(stack, set));
  bool compared = false;
  measures.indirect_skipped = "needs a set of one fringe, finer ones, and blocks with light";
  for (std::size_t coarse = 0; coarse < plan.sets.size(); ++coarse) {
    if (!IsCoarsest(plan, coarse)) continue;
    std::size_t fine = coarse;
    while (!IsFinest(plan, fine)) ++fine;
    if (fine == coarse) continue;
    std::vector<double> ratios;
    for (const std::size_t pixel : samples.pixels) {
      ratios.push_back(static_cast<double>(fits[fine].modulation_dn[pixel]) /
                       std::max(1e-3, static_cast<double>(fits[coarse].modulation_dn[pixel])));
    }
    const double contrast = Median(ratios);
    if (!compared || contrast < measures.fine_contrast) {
      measures.fine_contrast = contrast;
      measures.fine_fringes = plan.sets[fine].fringes;
    }
    compared = true;
    // A response of gamma 1.1 moves 3 phase steps by .03 rad, and they do not tell it.
    if (plan.sets[coarse].frame_of_step.size() < 4) {
      measures.indirect_skipped = "3 steps of the coarsest set do not tell the response apart";
      continue;
    }
    const Image<float> coordinate = FineCoordinate(plan, fits, plan.sets[coarse].axis);
    if (coordinate.empty() || blocks.empty()) continue;
    measures.indirect_skipped.clear();
    measures.indirect_rad =
        std::max(measures.indirect_rad, BlockDisagreement(blocks, samples, fits[coarse].phase_rad,
                                                          PhaseAt(plan.sets[coarse], coordinate)));
  }
  if (!compared) measures.skipped = "needs phase sets of two frequencies on one axis";
  return measures;
}

}  // namespace fringe_fusion::diagnosis
