#include "joint_unwrap.hpp"

#include <cmath>
#include <cstddef>
#include <limits>

#include "common/constants.hpp"

namespace fringe_fusion::decode {
namespace {
constexpr double kNegligible = 60.0;  // costs this far above the best add nothing to the odds
}  // namespace

JointUnwrap::JointUnwrap(const std::vector<PhaseSet>& sets, int size_px,
                         const DecodeContext& context)
    : size_px_(size_px), context_(context) {
  for (const PhaseSet& set : sets) fringes_.push_back(set.fringes);
  const double finest = fringes_.back();
  num_orders_ = static_cast<int>(std::ceil(finest)) + 2;
  num_candidates_ = (num_orders_ + 7) & ~7;
  const std::size_t num_others = fringes_.size() - 1;
  offsets_.resize(num_others * static_cast<std::size_t>(num_candidates_));
  for (std::size_t i = 0; i < num_others; ++i) {
    for (int k = 0; k < num_candidates_; ++k) {
      const double cycles = fringes_[i] / finest * (k - 1);
      offsets_[i * static_cast<std::size_t>(num_candidates_) + static_cast<std::size_t>(k)] =
          static_cast<float>(cycles - std::floor(cycles));
    }
    ratios_.push_back(static_cast<float>(fringes_[i] / finest));
  }
  residuals_.resize(num_others);
  weights_.resize(num_others);
  cost_.resize(static_cast<std::size_t>(num_candidates_));
  scratch_.resize(static_cast<std::size_t>(num_candidates_));
  const double systematic = context.config.phase_error_rad / kTwoPi;
  systematic2_ = systematic * systematic;
}

Unwrapped JointUnwrap::Run(const std::vector<StepFit>& fits, std::size_t x) {
  PrepareCosts(fits, x);
  JointArgs args;
  args.num_sets = static_cast<int>(residuals_.size());
  args.num_candidates = num_candidates_;
  args.offsets = offsets_.data();
  args.residuals = residuals_.data();
  args.weights = weights_.data();
  args.ratios = ratios_.data();
  args.coupling = coupling_;
  args.cost = cost_.data();
  args.scratch = scratch_.data();
  context_.kernels.joint_cost(args);
  const SetRow& finest = fits.back().row();
  const auto cycles = static_cast<double>(finest.cycles[x]);
  const Candidate best = FindBest(cycles, std::sqrt(static_cast<double>(finest.variance[x])));
  Unwrapped out;
  if (best.index < 0) {
    out.status = kRowDoubtfulOrder;
    return out;
  }
  out = Fuse(fits, x, (cycles + best.index - 1) / fringes_.back());
  out.log_odds = best.log_odds;
  const double limit = context_.config.max_level_sigma;
  // One degree of freedom per set beyond the first.
  const double allowed = limit * limit + static_cast<double>(residuals_.size()) - 1.0;
  if (!(best.cost <= allowed)) out.status = kRowResidual;
  return out;
}

void JointUnwrap::PrepareCosts(const std::vector<StepFit>& fits, std::size_t x) {
  const SetRow& finest = fits.back().row();
  const double variance = static_cast<double>(finest.variance[x]) + systematic2_;
  double information = 1.0 / variance;
  for (std::size_t i = 0; i < residuals_.size(); ++i) {
    const SetRow& row = fits[i].row();
    const double weight = 1.0 / (static_cast<double>(row.variance[x]) + systematic2_);
    const auto ratio = static_cast<double>(ratios_[i]);
    residuals_[i] = row.cycles[x] - ratios_[i] * finest.cycles[x];
    weights_[i] = static_cast<float>(weight);
    information += ratio * ratio * weight;
  }
  coupling_ = static_cast<float>(1.0 / information);
}

JointUnwrap::Candidate JointUnwrap::FindBest(double reference_cycles,
                                             double reference_sigma) const {
  // Orders that place the pixel outside the projector are no candidates.
  const double margin = 3.0 * reference_sigma;
  const auto inside = [&](int k) {
    const double cycles = reference_cycles + k - 1;
    return cycles >= -margin && cycles <= fringes_.back() + margin;
  };
  Candidate best;
  best.cost = std::numeric_limits<double>::infinity();
  for (int k = 0; k < num_orders_; ++k) {
    const auto cost = static_cast<double>(cost_[static_cast<std::size_t>(k)]);
    if (cost < best.cost && inside(k)) {
      best.index = k;
      best.cost = cost;
    }
  }
  if (best.index < 0) return best;
  double others = 0.0;
  for (int k = 0; k < num_orders_; ++k) {
    const double above = static_cast<double>(cost_[static_cast<std::size_t>(k)]) - best.cost;
    if (k != best.index && above < 2.0 * kNegligible && inside(k)) others += std::exp(-0.5 * above);
  }
  best.log_odds = others > 0.0 ? -std::log(others) : kNegligible;
  return best;
}

// Science 2.4: inverse variances. `ratio` is the coordinate as a share of the axis.
Unwrapped JointUnwrap::Fuse(const std::vector<StepFit>& fits, std::size_t x, double ratio) const {
  double information = 0.0;
  double sum = 0.0;
  for (std::size_t i = 0; i < fits.size(); ++i) {
    const auto cycles = static_cast<double>(fits[i].row().cycles[x]);
    const double order = std::round(fringes_[i] * ratio - cycles);
    const double weight =
        fringes_[i] * fringes_[i] / static_cast<double>(fits[i].row().variance[x]);
    information += weight;
    sum += weight * (cycles + order) / fringes_[i];
  }
  Unwrapped out;
  out.coordinate_px = size_px_ * sum / information - 0.5;
  out.variance_px2 = static_cast<double>(size_px_) * size_px_ / information;
  return out;
}

}  // namespace fringe_fusion::decode
